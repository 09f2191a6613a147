// Stand-in, see WMX3Api.h.
#pragma once

#include "WMX3Api.h"

namespace wmx3Api {

class Io {
public:
    WMX3Api* wmx3Api;
    explicit Io(WMX3Api* f) : wmx3Api(f) {}
    WMX3APIFUNC SetOutBit(int addr, int bit, unsigned char data);
    WMX3APIFUNC GetInBytes(int addr, int size, unsigned char* pData);
    WMX3APIFUNC GetOutBytes(int addr, int size, unsigned char* pData);
};

}  // namespace wmx3Api
