// Stand-in, see WMX3Api.h.
#pragma once

#include "CoreMotionApi.h"

namespace wmx3Api {

class AdvancedMotion;

class AdvMotion {
public:
    AdvancedMotion* amApi;
    explicit AdvMotion(AdvancedMotion* f) : amApi(f) {}

    struct SplinePoint {
        double pos[constants::maxSplineDimensions] = {};
    };
    struct PointTimeSplineCommand {
        unsigned int dimensionCount = 0;
        int axis[constants::maxSplineDimensions] = {};
    };
#ifdef STAND_IN_WHOLE_MILLISECONDS  // older versions
    using Time = unsigned int;
#else
    using Time = double;
#endif
    WMX3APIFUNC CreateSplineBuffer(int channel, unsigned int points);
    WMX3APIFUNC FreeSplineBuffer(int channel);
    WMX3APIFUNC GetSplineBufferPoints(int channel, unsigned int* pPoints);
    WMX3APIFUNC StartCSplinePos(int channel, PointTimeSplineCommand* pSplineCommand, unsigned int numPoints, SplinePoint* pPoint,
                                Time* pPointTimeMilliseconds);
};

class AdvancedMotion {
public:
    WMX3Api* wmx3Api;
    AdvMotion* advMotion;

    explicit AdvancedMotion(WMX3Api* f);
    ~AdvancedMotion();
    AdvancedMotion(const AdvancedMotion&) = delete;
    AdvancedMotion& operator=(const AdvancedMotion&) = delete;
};

}  // namespace wmx3Api
