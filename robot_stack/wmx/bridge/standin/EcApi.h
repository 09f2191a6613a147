// Stand-in, see WMX3Api.h.
#pragma once

#include "WMX3Api.h"

#define ECAPIFUNC long

namespace wmx3Api {
namespace ecApi {

class Ecat {
public:
    WMX3Api* wmx3Api;
    explicit Ecat(WMX3Api* f) : wmx3Api(f) {}
    ECAPIFUNC ScanNetwork();
};

}  // namespace ecApi
}  // namespace wmx3Api
