// Stand-in for the vendor's library: the documented signatures that the bridge uses, on a running simulated engine.
//
// No text or code of the vendor's. standin.cpp forwards each call by the simulated engine's own protocol. The path of
// CreateDevice is that engine's runtime folder. Numbers of enumerations differ from the port's; records have further fields.
#pragma once

#include <memory>

#include "enumerations.hpp"

#define WMX3APIFUNC long

namespace standin {
struct Device;
}

namespace wmx3Api {

namespace constants {
constexpr int maxAxes = 128, maxInterrupts = 2, maxDevices = 256, maxDeviceName = 64, maxSplineDimensions = 6;
}

struct DeviceInfoA {
    unsigned int id = 0;
    DeviceType::T type = DeviceType::DeviceTypeNormal;
    unsigned int watchdog = 0, watchdogCount = 0;
    char name[constants::maxDeviceName] = {};
};

struct DevicesInfoA {
    unsigned int count = 0;
    DeviceInfoA devices[constants::maxDevices];
};

class WMX3Api {
public:
    std::shared_ptr<standin::Device> dev;

    WMX3Api();
    ~WMX3Api();

    static WMX3APIFUNC ErrorToString(int errCode, char* pString, unsigned int size);
    bool IsDeviceValid();
    WMX3APIFUNC StopEngine(unsigned int waitTimeMilliseconds = 0);
    WMX3APIFUNC CreateDevice(char* path, DeviceType::T type = DeviceType::DeviceTypeNormal, unsigned int waitTimeMilliseconds = 0);
    WMX3APIFUNC CloseDevice();
    WMX3APIFUNC GetDeviceID(int* id);
    WMX3APIFUNC StartCommunication(unsigned int waitTimeMilliseconds = 0);
    WMX3APIFUNC StopCommunication(unsigned int waitTimeMilliseconds = 0);
    WMX3APIFUNC GetAllDevices(DevicesInfoA* devices);
    WMX3APIFUNC SetDeviceName(char* name);
    WMX3APIFUNC GetDeviceName(char* nameBuf, unsigned int bufSize);
};

}  // namespace wmx3Api
