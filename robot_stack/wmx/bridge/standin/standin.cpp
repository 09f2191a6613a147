// The stand-in's behaviour: each call is a request to a running simulated engine, its status comes from that engine's page.
#include <sys/socket.h>
#include <sys/un.h>
#include <time.h>

#include <algorithm>
#include <thread>

#include "AdvancedMotionApi.h"
#include "CoreMotionApi.h"
#include "EcApi.h"
#include "IOApi.h"
#include "WMX3Api.h"
// The vendor's headers come first.
#include "../parameter_file.hpp"
#include "../records.hpp"
#include "../status_page.hpp"

using records::Decode;
using records::Encode;
using wire::List;
using wire::Value;

namespace {

constexpr std::int64_t STALE_NS = 1'000'000'000;
constexpr int TIMEOUT_S = 10;

std::int64_t now_ns() {
    timespec time{};
    clock_gettime(CLOCK_MONOTONIC, &time);
    return std::int64_t{time.tv_sec} * 1'000'000'000 + time.tv_nsec;
}

void rest() { std::this_thread::sleep_for(std::chrono::microseconds(500)); }

template <class... A>
List arguments(A... values) {
    List made;
    (made.push_back(wire::of(values)), ...);
    return made;
}

}  // namespace

namespace standin {

// One device: a connection to the engine, and its status page.
struct Device {
    std::string folder;
    int socket = -1;
    int id = 0;
    std::int64_t number = 0;
    wire::Decoder decoder;
    std::unique_ptr<page::Mapping> status;
    ino_t inode = 0;
    bool delayed = false;

    ~Device() { forget(); }

    void forget() {
        if (socket >= 0) close(socket);
        socket = -1;
        id = 0;
        decoder = {};
        status.reset();
    }

    // The port's code; its values in results.
    int ask(const std::string& method, List given, List* results = nullptr) {
        if (socket < 0) return codes::DeviceIsNull;
        List message = arguments(++number, method);
        std::move(given.begin(), given.end(), std::back_inserter(message));
        std::string frame;
        try {
            frame = wire::frame(message);
        } catch (const wire::FrameError&) {
            return codes::ArgumentOutOfRange;
        }
        if (send(socket, frame.data(), frame.size(), MSG_NOSIGNAL) != static_cast<ssize_t>(frame.size())) return lost();
        char data[16384];
        while (true) {
            ssize_t count = recv(socket, data, sizeof data, 0);
            if (count < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) return codes::APIChannelTimeOut;
            if (count <= 0) return lost();
            decoder.feed(data, static_cast<std::size_t>(count));
            while (auto answer = decoder.next()) {
                if (*answer->front().as<std::int64_t>() != number) continue;
                int code = static_cast<int>(*(*answer)[1].as<std::int64_t>());
                if (results) results->assign(answer->begin() + 2, answer->end());
                if (code == codes::DeviceIsNull) forget();
                return code;
            }
        }
    }

    int lost() {
        forget();
        return codes::IMLibIsNotRunning;
    }

    int create(const std::string& path, int type) {
        folder = path;
        socket = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
        sockaddr_un address{};
        address.sun_family = AF_UNIX;
        std::string file = folder + "/" + tables::SOCKET_FILE;
        if (file.size() >= sizeof address.sun_path) return lost();
        std::copy(file.begin(), file.end(), address.sun_path);
        timeval limit{TIMEOUT_S, 0};
        setsockopt(socket, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
        if (connect(socket, reinterpret_cast<sockaddr*>(&address), sizeof address)) return lost();
        List results;
        int code = ask("CreateDevice", arguments(type), &results);
        if (code)
            forget();
        else
            id = records::whole(results.at(0));
        return code;
    }

    bool map() {
        std::string path = folder + "/" + tables::STATUS_FILE;
        struct stat found {};
        if (stat(path.c_str(), &found)) return false;
        if (status && found.st_ino == inode) return true;
        int descriptor = open(path.c_str(), O_RDONLY | O_CLOEXEC);
        if (descriptor < 0) return false;
        status = std::make_unique<page::Mapping>(descriptor, static_cast<std::size_t>(found.st_size), PROT_READ);
        inode = found.st_ino;
        return true;
    }

    // A consistent copy of the engine's page.
    int read(std::optional<page::Status>& into) {
        if (socket < 0) return codes::DeviceIsNull;
        if (!status && !map()) return codes::StatusChannelNull;
        int code = copy(into);
        if (code && map()) code = copy(into);
        return code;
    }

    int copy(std::optional<page::Status>& into) {
        page::Mapping& from = *status;
        if (!into) into.emplace(from.head(2), from.head(3), from.head(4));
        for (int attempt = 0; attempt < 2000; ++attempt) {
            std::int64_t before = from.sequence().load(std::memory_order_acquire);
            const std::uint8_t* at = from.bytes() + page::HEAD_NUMBERS * 8;
            auto get = [&at](void* data, std::size_t bytes) {
                std::memcpy(data, at, bytes);
                at += bytes;
            };
            get(&into->meta, sizeof into->meta);
            get(into->reals.data(), 8 * into->reals.size());
            get(into->flags.data(), 8 * into->flags.size());
            get(into->inputs.data(), into->inputs.size());
            get(into->outputs.data(), into->outputs.size());
            std::atomic_thread_fence(std::memory_order_acquire);
            if (!(before & 1) && from.sequence().load(std::memory_order_relaxed) == before)
                return now_ns() - into->meta.stamp_ns > STALE_NS ? codes::StatusChannelError : 0;
            if (attempt > 50) std::this_thread::yield();
        }
        return codes::StatusChannelError;
    }

    std::size_t n_axes() { return status || map() ? static_cast<std::size_t>(status->head(2)) : 0; }
};

}  // namespace standin

namespace wmx3Api {

namespace {

long ask(WMX3Api* api, const char* method, List given, List* results = nullptr) {
    return records::their_code(api->dev->ask(method, std::move(given), results));
}

long ask(CoreMotion* core, const char* method, List given, List* results = nullptr) {
    return ask(core->wmx3Api, method, std::move(given), results);
}

Value chosen(int axis) { return {arguments(axis)}; }

Value chosen(AxisSelection* selection) {
    List axes;
    for (int index = 0; index < selection->axisCount; ++index) axes.push_back(wire::of(selection->axis[index]));
    return {std::move(axes)};
}

template <class R>
Value record(CoreMotion* core, R& value) {
    List fields;
    vendor::visit(value, Encode{fields, core->wmx3Api->dev->n_axes()});
    return {std::move(fields)};
}

template <class C>
long start(CoreMotion* core, const char* method, unsigned count, C* commands) {
    List items;
    for (unsigned index = 0; index < count; ++index) items.push_back(record(core, commands[index]));
    return ask(core, method, arguments(std::move(items)));
}

template <class R>
long block(CoreMotion* core, const char* method, List given, R* into) {
    List results;
    long code = ask(core, method, std::move(given), &results);
    if (!code) Decode::decode(results.at(0), *into, core->wmx3Api->dev->n_axes());
    return code;
}

long text(char* into, unsigned int size, const std::string& written) {
    if (size) into[written.copy(into, size - 1)] = '\0';
    return 0;
}

}  // namespace

WMX3Api::WMX3Api() : dev(std::make_shared<standin::Device>()) {}
WMX3Api::~WMX3Api() = default;

long WMX3Api::ErrorToString(int errCode, char* pString, unsigned int size) { return text(pString, size, "error " + std::to_string(errCode)); }

bool WMX3Api::IsDeviceValid() {
    std::optional<page::Status> status;
    return dev->id && !dev->read(status);
}

long WMX3Api::CreateDevice(char* path, DeviceType::T type, unsigned int waitTimeMilliseconds) {
    std::int64_t until = now_ns() + std::int64_t{waitTimeMilliseconds} * 1'000'000;
    while (true) {
        // For tests: with this file no device is created.
        bool refused = access((std::string(path) + "/standin.no_device").c_str(), F_OK) == 0;
        int code = refused ? codes::EngineNotStartedInSpecifiedTime : dev->create(path, records::ours<DeviceType::T>(type));
        bool starting = code == codes::IMLibIsNotRunning || code == codes::EngineNotStartedInSpecifiedTime;
        if (!starting || now_ns() >= until) return records::their_code(code);
        rest();
    }
}

long WMX3Api::CloseDevice() {
    long code = ask(this, "CloseDevice", {});
    if (!code) dev->forget();
    return code;
}

long WMX3Api::StopEngine(unsigned int) {
    long code = ask(this, "StopEngine", {});
    if (!code) dev->forget();
    return code;
}

long WMX3Api::GetDeviceID(int* id) {
    *id = dev->id;
    return records::their_code(dev->id ? 0 : codes::DeviceIsNull);
}

long WMX3Api::StartCommunication(unsigned int waitTimeMilliseconds) {
    long code = ask(this, "StartCommunication", {});
    std::int64_t until = now_ns() + std::int64_t{waitTimeMilliseconds} * 1'000'000;
    while (!code) {
        std::optional<page::Status> status;
        if (int unread = dev->read(status)) return records::their_code(unread);
        if (status->meta.state == records::ours<EngineState::T>(EngineState::Communicating)) return 0;
        if (now_ns() >= until) return records::their_code(codes::CommNotStartedInSpecifiedTime);
        rest();
    }
    return code;
}

long WMX3Api::StopCommunication(unsigned int waitTimeMilliseconds) {
    return ask(this, "WMX3Api.StopCommunication", arguments(waitTimeMilliseconds));
}

long WMX3Api::GetAllDevices(DevicesInfoA* devices) {
    List results;
    long code = ask(this, "WMX3Api.GetAllDevices", {}, &results);
    if (code) return code;
    const List& whole = records::list(results.at(0), 2);
    const List& all = records::list(whole.at(1), constants::maxDevices);
    devices->count = static_cast<unsigned>(all.size());
    for (std::size_t index = 0; index < all.size(); ++index) {
        const List& fields = records::list(all[index], 5);
        DeviceInfoA& one = devices->devices[index];
        one.id = records::natural(fields[0]);
        one.type = records::named<DeviceType::T>(fields[1]);
        one.watchdog = records::natural(fields[2]);
        one.watchdogCount = records::natural(fields[3]);
        text(one.name, sizeof one.name, records::text(fields[4]));
    }
    return 0;
}

long WMX3Api::SetDeviceName(char* name) {
    dev->delayed = name == std::string("wmx_bridge");
    return ask(this, "WMX3Api.SetDeviceName", arguments(std::string(name)));
}

long WMX3Api::GetDeviceName(char* nameBuf, unsigned int bufSize) {
    List results;
    long code = ask(this, "WMX3Api.GetDeviceName", {}, &results);
    return code ? code : text(nameBuf, bufSize, records::text(results.at(0)));
}

CoreMotion::CoreMotion(WMX3Api* f)
    : wmx3Api(f),
      axisControl(new AxisControl(this)),
      motion(new Motion(this)),
      velocity(new Velocity(this)),
      home(new Home(this)),
      config(new Config(this)) {}

CoreMotion::~CoreMotion() {
    delete axisControl;
    delete motion;
    delete velocity;
    delete home;
    delete config;
}

long CoreMotion::ErrorToString(int errCode, char* pString, unsigned int size) { return WMX3Api::ErrorToString(errCode, pString, size); }

namespace {

// Row of the page into a field of the vendor's status.
struct ToField {
    const page::Status& from;
    std::size_t axis;

    template <class F>
    void flag(int row, F& field, bool again) {
        if (again) return;  // a field that stands for two rows has the first one's value
        std::int64_t value = from.flags[row * from.n_axes + axis];
        if constexpr (std::is_enum_v<F>)
            field = static_cast<F>(records::theirs<F>(static_cast<int>(value)));
        else
            field = static_cast<F>(value);
    }
    void real(int row, double& field, bool) { field = from.reals[row * from.n_axes + axis]; }
};

}  // namespace

namespace {

// For tests: while the engine's folder has this file, the bridge's own status takes its number of milliseconds; 0: hangs, -1: the device
// is lost.
bool delay(const std::string& path) {
    int ms = -1;
    while (FILE* file = std::fopen(path.c_str(), "r")) {
        if (std::fscanf(file, "%d", &ms) != 1) ms = 0;
        std::fclose(file);
        if (ms) break;
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    if (ms > 0) std::this_thread::sleep_for(std::chrono::milliseconds(ms));
    return ms != -1 || access(path.c_str(), F_OK) != 0;
}

}  // namespace

long CoreMotion::GetStatus(CoreMotionStatus* pStatus) {
    if (wmx3Api->dev->delayed && !delay(wmx3Api->dev->folder + "/standin.status_ms")) return records::their_code(codes::DeviceIsNull);
    std::optional<page::Status> status;
    if (int code = wmx3Api->dev->read(status)) return records::their_code(code);
    const page::Meta& meta = status->meta;
    pStatus->engineState = static_cast<EngineState::T>(records::theirs<EngineState::T>(static_cast<int>(meta.state)));
    pStatus->numOfInterrupts = 1;
    pStatus->cycleTimeMilliseconds[0] = 1e-6 * static_cast<double>(meta.cycle_ns);
    pStatus->cycleCounter[0] = meta.cycles;
    pStatus->emergencyStop = meta.stop != 0;
    pStatus->emergencyStopLevel = static_cast<EStopLevel::T>(records::theirs<EStopLevel::T>(static_cast<int>(meta.level)));
    for (std::size_t axis = 0; axis < status->n_axes; ++axis) vendor::visit_status(pStatus->axesStatus[axis], ToField{*status, axis});
    return 0;
}

long CoreMotion::ExecEStop(EStopLevel::T level) { return ask(this, "CoreMotion.ExecEStop", arguments(records::ours<EStopLevel::T>(level))); }
long CoreMotion::ReleaseEStop() { return ask(this, "CoreMotion.ReleaseEStop", {}); }

#define ON_AXES(owner, name)                                                                                     \
    long owner::name(int axis) { return ask(cmApi, STAND_IN_OWNER #name, {chosen(axis)}); }                       \
    long owner::name(AxisSelection* pAxisSelection) { return ask(cmApi, STAND_IN_OWNER #name, {chosen(pAxisSelection)}); }
#define START(owner, name, kind, request)                                                                        \
    long owner::name(kind* command) { return start(cmApi, request, 1, command); }                                 \
    long owner::name(unsigned int numCommands, kind* commands) { return start(cmApi, request, numCommands, commands); }

#define STAND_IN_OWNER "axisControl."
ON_AXES(AxisControl, ClearAmpAlarm)
ON_AXES(AxisControl, ClearAxisAlarm)
long AxisControl::SetServoOn(int axis, int newStatus) { return ask(cmApi, "axisControl.SetServoOn", {chosen(axis), wire::of(newStatus)}); }
long AxisControl::SetServoOn(AxisSelection* selection, int newStatus) {
    return ask(cmApi, "axisControl.SetServoOn", {chosen(selection), wire::of(newStatus)});
}
long AxisControl::SetAxisCommandMode(int axis, AxisCommandMode::T mode) {
    return ask(cmApi, "axisControl.SetAxisCommandMode", arguments(axis, records::ours<AxisCommandMode::T>(mode)));
}
#undef STAND_IN_OWNER
#define STAND_IN_OWNER "motion."
ON_AXES(Motion, Stop)
ON_AXES(Motion, ExecQuickStop)
START(Motion, StartPos, Motion::PosCommand, "motion.StartPos")
START(Motion, StartMov, Motion::PosCommand, "motion.StartMov")
#undef STAND_IN_OWNER
#define STAND_IN_OWNER "velocity."
ON_AXES(Velocity, Stop)
ON_AXES(Velocity, ExecQuickStop)
START(Velocity, StartVel, Velocity::VelCommand, "velocity.StartVel")
START(Velocity, StartVel, Velocity::TimedVelCommand, "velocity.StartVel_TimedVel")
#undef STAND_IN_OWNER
#define STAND_IN_OWNER "home."
ON_AXES(Home, StartHome)
long Home::Cancel(int axis) { return ask(cmApi, "home.Cancel", arguments(axis)); }
long Home::SetCommandPos(int axis, double position) { return ask(cmApi, "home.SetCommandPos", arguments(axis, position)); }

long Config::GetAxisParam(AxisParam* pParam) { return block(cmApi, "config.GetAxisParam", {}, pParam); }
long Config::SetGearRatio(int axis, double numerator, double denominator) {
    return ask(cmApi, "config.SetGearRatio", arguments(axis, numerator, denominator));
}
long Config::GetGearRatio(int axis, double* pNumerator, double* pDenominator) {
    List results;
    long code = ask(cmApi, "config.GetGearRatio", arguments(axis), &results);
    if (!code) *pNumerator = records::real(results.at(0)), *pDenominator = records::real(results.at(1));
    return code;
}
long Config::SetAxisPolarity(int axis, char polarity) {
    return ask(cmApi, "config.SetAxisPolarity", arguments(axis, static_cast<int>(static_cast<signed char>(polarity))));
}
long Config::GetAxisPolarity(int axis, char* pPolarity) {
    List results;
    long code = ask(cmApi, "config.GetAxisPolarity", arguments(axis), &results);
    if (!code) *pPolarity = static_cast<char>(records::whole(results.at(0)));
    return code;
}

#define BLOCK(name)                                                                                                       \
    long Config::Get##name(int axis, name* pParam) { return block(cmApi, "config.Get" #name, arguments(axis), pParam); }   \
    long Config::Set##name(int axis, name* pParam, name*) { return ask(cmApi, "config.Set" #name, {wire::of(axis), record(cmApi, *pParam)}); }

BLOCK(FeedbackParam)
// A field that the port does not know must survive a change by the bridge.
constexpr unsigned KEPT = 5;
long Config::GetHomeParam(int axis, HomeParam* pParam) {
    pParam->multipleZPulse = KEPT;
    return block(cmApi, "config.GetHomeParam", arguments(axis), pParam);
}
long Config::SetHomeParam(int axis, HomeParam* pParam, HomeParam*) {
    if (pParam->multipleZPulse != KEPT) return records::their_code(codes::ParameterSettingsInvalid);
    return ask(cmApi, "config.SetHomeParam", {wire::of(axis), record(cmApi, *pParam)});
}
BLOCK(LimitParam)
BLOCK(MotionParam)
BLOCK(AlarmParam)
long Config::GetEmergencyStopParam(EmergencyStopParam* pParam) { return block(cmApi, "config.GetEmergencyStopParam", {}, pParam); }
long Config::SetEmergencyStopParam(EmergencyStopParam* pParam, EmergencyStopParam*) {
    return ask(cmApi, "config.SetEmergencyStopParam", {record(cmApi, *pParam)});
}

// The vendor's files have all axes; an entry that the port does not know must survive a change by the bridge.
long Config::GetAndExportAll(char* pPath) {
    List results;
    long code = ask(cmApi, "GetAllParameters", {}, &results);
    if (code) return code;
    auto plain = [](const Value& numbers) {
        std::vector<double> made;
        for (auto& one : records::list(numbers, 1000)) made.push_back(records::real(one));
        return made;
    };
    parameter_file::Element root{"Parameters", "ver=\"1.00\"", "", {}};
    parameter_file::Element* whole = root.child("GlobalParameters", true);
    parameter_file::set_numbers(*whole, tables::GLOBAL_ENTRIES, plain(results.at(0)));
    whole->at("StandInParam/Unknown", true)->text = "7";
    std::vector<double> normal;
    for (auto& entry : tables::AXIS_ENTRIES) normal.push_back(entry.normal);
    const List& axes = records::list(results.at(1), tables::MAX_AXES);
    for (std::size_t axis = 0; axis < tables::MAX_AXES; ++axis)
        parameter_file::set_numbers(*parameter_file::axis_block(root, axis, true), tables::AXIS_ENTRIES,
                                    axis < axes.size() ? plain(axes[axis]) : normal);
    try {
        parameter_file::write(pPath, root);
    } catch (const std::runtime_error&) {
        return records::their_code(codes::FileOperationFailed);
    }
    return 0;
}

long Config::ImportAndSetAll(char* pPath, SystemParam*, AxisParam*) {
    try {
        auto root = parameter_file::read(pPath);
        auto whole = root->child("GlobalParameters");
        if (!whole || parameter_file::number_of(whole, {"StandInParam/Unknown", 0, true}).as<std::int64_t>() == nullptr ||
            *parameter_file::number_of(whole, {"StandInParam/Unknown", 0, true}).as<std::int64_t>() != 7)
            return records::their_code(codes::ParameterFileParseError);
        List axes;
        for (std::size_t axis = 0; axis < cmApi->wmx3Api->dev->n_axes(); ++axis)
            axes.push_back({parameter_file::numbers_of(parameter_file::axis_block(*root, axis), tables::AXIS_ENTRIES)});
        return ask(cmApi, "SetAllParameters", arguments(parameter_file::numbers_of(whole, tables::GLOBAL_ENTRIES), std::move(axes)));
    } catch (const parameter_file::ParseError&) {
        return records::their_code(codes::ParameterFileParseError);
    } catch (const std::runtime_error&) {
        return records::their_code(codes::FileOperationFailed);
    }
}

AdvancedMotion::AdvancedMotion(WMX3Api* f) : wmx3Api(f), advMotion(new AdvMotion(this)) {}
AdvancedMotion::~AdvancedMotion() { delete advMotion; }

long AdvMotion::CreateSplineBuffer(int channel, unsigned int points) {
    return ask(amApi->wmx3Api, "advMotion.CreateSplineBuffer", arguments(channel, points));
}
long AdvMotion::FreeSplineBuffer(int channel) { return ask(amApi->wmx3Api, "advMotion.FreeSplineBuffer", arguments(channel)); }
long AdvMotion::GetSplineBufferPoints(int channel, unsigned int* pPoints) {
    List results;
    long code = ask(amApi->wmx3Api, "advMotion.GetSplineBufferPoints", arguments(channel), &results);
    if (!code) *pPoints = records::natural(results.at(0));
    return code;
}
long AdvMotion::StartCSplinePos(int channel, PointTimeSplineCommand* command, unsigned int numPoints, SplinePoint* points, Time* times) {
    List axes;
    std::vector<double> rows;
    for (unsigned dimension = 0; dimension < command->dimensionCount; ++dimension) axes.push_back(wire::of(command->axis[dimension]));
    for (unsigned index = 0; index < numPoints; ++index) rows.insert(rows.end(), points[index].pos, points[index].pos + command->dimensionCount);
    return ask(amApi->wmx3Api, "StartSpline",
               arguments(channel, std::move(axes), wire::pack(rows), wire::pack(std::vector<double>(times, times + numPoints))));
}

long Io::SetOutBit(int addr, int bit, unsigned char data) { return ask(wmx3Api, "Io.SetOutBit", arguments(addr, bit, static_cast<int>(data))); }

namespace {

long image(WMX3Api* api, std::vector<std::uint8_t> page::Status::*which, int addr, int size, unsigned char* into) {
    std::optional<page::Status> status;
    if (int code = api->dev->read(status)) return records::their_code(code);
    auto& bytes = (*status).*which;
    if (addr < 0 || size <= 0 || static_cast<std::size_t>(addr + size) > bytes.size()) return records::their_code(codes::IOSizeOutOfRange);
    std::copy_n(bytes.begin() + addr, size, into);
    return 0;
}

}  // namespace

long Io::GetInBytes(int addr, int size, unsigned char* pData) { return image(wmx3Api, &page::Status::inputs, addr, size, pData); }
long Io::GetOutBytes(int addr, int size, unsigned char* pData) { return image(wmx3Api, &page::Status::outputs, addr, size, pData); }

long ecApi::Ecat::ScanNetwork() { return ask(wmx3Api, "Ecat.ScanNetwork", arguments(0)); }

}  // namespace wmx3Api
