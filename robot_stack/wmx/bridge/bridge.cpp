// The engine bridge: the vendor's library behind the socket and the shared memory of the simulated engine.
//
//   wmx_bridge --folder /run/wmx_bridge --root /opt/lmx/ --axes 8 --io-bytes 8
//
// Each client has a thread and a device of its own. A device of the bridge itself reads the status once per cycle; it lives
// as long as any client's device does, so that the engine ends with the last one, and it is not shown to clients.
// A command is answered after its effect on the status is published. No call waits for a motion.
#include <poll.h>
#include <signal.h>
#include <sys/file.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <time.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdio>
#include <cstdlib>
#include <list>
#include <mutex>
#include <thread>
#include <unordered_map>

#include <WMX3Api.h>
#include <CoreMotionApi.h>
#include <AdvancedMotionApi.h>
#include <EcApi.h>
#include <IOApi.h>

#include "parameter_file.hpp"
#include "records.hpp"
#include "status_page.hpp"

#ifndef WMX_IO_CLASS  // IO in newer versions
#define WMX_IO_CLASS Io
#endif

using records::BadArgument;
using records::Decode;
using records::Encode;
using records::named;
using records::narrow;
using records::natural;
using records::real;
using records::Unfit;
using records::whole;
using wire::List;
using wire::Value;

namespace {

// The port's numbers of the codes that the bridge makes itself.
constexpr int API_CHANNEL_ERROR = 269, CLOSE_LOCK = 298, DEVICE_IS_NULL = 301, NO_SUPPORTED_FUNCTION = 304,
              NOT_STARTED_IN_TIME = 1283, COMM_NOT_STARTED_IN_TIME = 1285, COMM_NOT_STOPPED_IN_TIME = 1286, ARGUMENT_RANGE = 1555,
              RESOURCE_IN_USE = 1561, FILE_FAILED = 1562, PARSE_FAILED = 65542, SETTINGS_INVALID = 65536, TIME_RANGE = 65592,
              POINTS_TOO_CLOSE = 94222, DIMENSION_RANGE = 94224;

constexpr std::int64_t MS = 1'000'000;
constexpr std::int64_t LOST_NS = 2000 * MS;      // without a new status while the bus runs or calls fail, the engine is lost
constexpr std::int64_t GRACE_NS = 15'000 * MS;   // the engine is kept for clients whose creation of a device timed out
constexpr auto CREATION_WAIT = std::chrono::milliseconds(300);  // below the clients' own timeout
constexpr unsigned DEVICE_MS = 500;  // for a further device of a running engine, below the clients' own timeout
constexpr std::size_t MAX_CLIENTS = 64, NAME_LENGTH = 64, LONGEST_LIST = 8000;
constexpr int CLOSE_TRIES = 20, SEND_TIMEOUT_S = 1;
constexpr auto CLOSE_PAUSE = std::chrono::milliseconds(20);

struct Options {
    std::string folder, root;
    std::size_t axes = 8, io_bytes = 8;
    unsigned start_ms = 10'000;  // given to the first creation of a device, which starts the engine
    int orphan_ms = 15'000;      // a client that is gone keeps its device for so long, as with the vendor's watchdog
    int period_us = 500;         // between two looks at the status: half a cycle
    int stop_ms = 2000;          // for the axes to stop when the bridge ends
} options;

std::atomic<bool> ending = false;   // asked to end: no more commands, the axes stop
std::atomic<bool> closing = false;  // they stand: devices are closed

std::int64_t now_ns() {
    timespec time{};
    clock_gettime(CLOCK_MONOTONIC, &time);
    return std::int64_t{time.tv_sec} * 1'000'000'000 + time.tv_nsec;
}

// One device with its objects.
struct Session {
    WMX3Api api;
    CoreMotion core{&api};
    WMX_IO_CLASS io{&api};
    Ecat ecat{&api};
    AdvancedMotion advanced{&api};
    std::int64_t epoch = 0;

    int create(DeviceType::T type, unsigned wait_ms) {
        std::string root = options.root;
        return records::our_code(api.CreateDevice(root.data(), type, wait_ms));
    }

    int close() {
        int code = 0;
        for (int attempt = 0; attempt < CLOSE_TRIES; ++attempt) {
            code = records::our_code(api.CloseDevice());
            if (code != CLOSE_LOCK) break;
            std::this_thread::sleep_for(CLOSE_PAUSE);
        }
        return code;
    }

    int id() {
        int number = 0;
        api.GetDeviceID(&number);
        return number;
    }
};

// Field of the vendor's status into a row of the page.
struct ToRow {
    page::Status& into;
    std::size_t axis;

    template <class F>
    void flag(int row, F& field, bool) {
        std::int64_t value = static_cast<std::int64_t>(field);
        if constexpr (std::is_enum_v<F>) value = records::ours<F>(static_cast<int>(field));
        into.flags[row * into.n_axes + axis] = value;
    }
    void real(int row, double field, bool) { into.reals[row * into.n_axes + axis] = field; }
};

// The bridge's own device and the status page.
class Engine {
public:
    Engine() : status_(options.axes, options.io_bytes, options.io_bytes) {
        epoch_ = now_ns();  // invalidates the devices of an earlier bridge
        idle();
        writer_ = std::make_unique<page::Writer>(options.folder + "/" + tables::STATUS_FILE, status_, 0640);
    }

    // Keeps the engine for one more client. 0, or why there is none yet.
    int hold() {
        std::unique_lock lock(mutex_);
        if (!own_) {
            grace_ns_ = now_ns() + GRACE_NS;
            wanted_ = true;
            failure_ = NOT_STARTED_IN_TIME;
            changed_.notify_all();
            changed_.wait_for(lock, CREATION_WAIT, [this] { return own_ != nullptr || !wanted_; });
            if (!own_) return failure_;
        }
        ++users_;
        return 0;
    }

    // Without the lock: a command is carried out even if the reading of the status hangs.
    std::int64_t epoch() const { return epoch_; }

    // A client's device is closed. The bridge's own one is closed with the last.
    void release(std::int64_t epoch) {
        std::lock_guard lock(mutex_);
        if (epoch != epoch_ || users_ == 0) return;
        grace_ns_ = 0;
        if (--users_ == 0) close_own();
    }

    // A client has stopped the engine for all.
    void stopped() {
        std::lock_guard lock(mutex_);
        close_own();
    }

    int own_id() {
        std::lock_guard lock(mutex_);
        return own_ ? own_->id() : 0;
    }

    // Publishes the present status, so that the answer to a command never comes before its effect.
    void publish() {
        std::lock_guard lock(mutex_);
        publish_locked();
    }

    void run() {
        auto due = std::chrono::steady_clock::now();
        while (!ending) {
            due += std::chrono::microseconds(options.period_us);
            auto now = std::chrono::steady_clock::now();
            if (due < now) due = now;
            std::this_thread::sleep_until(due);
            std::unique_lock lock(mutex_);
            if (wanted_ && !own_) open(lock);
            if (own_ && !users_ && now_ns() > grace_ns_) close_own();
            publish_locked();
        }
        finish();
    }

private:
    std::mutex mutex_;
    std::condition_variable changed_;
    std::unique_ptr<Session> own_;
    std::unique_ptr<page::Writer> writer_;
    page::Status status_;
    CoreMotionStatus theirs_;
    std::atomic<std::int64_t> epoch_ = 0;
    std::int64_t counter_ = -1, seen_ns_ = 0, good_ns_ = 0, grace_ns_ = 0;
    std::size_t users_ = 0;
    bool wanted_ = false;
    int failure_ = 0;

    // The first device starts the engine, which takes seconds: without the lock, so that the page stays fresh.
    void open(std::unique_lock<std::mutex>& lock) {
        auto made = std::make_unique<Session>();
        int code = 0;
        std::atomic<bool> done = false;
        lock.unlock();
        std::thread creation([&] {
            code = made->create(DeviceType::DeviceTypeNormal, options.start_ms);
            char name[] = "wmx_bridge";
            if (!code) made->api.SetDeviceName(name);
            done = true;
        });
        while (!done) {
            publish();
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
        }
        creation.join();
        lock.lock();
        wanted_ = false;
        failure_ = code;
        if (!code) {
            own_ = std::move(made);
            counter_ = -1;
            good_ns_ = now_ns();
        }
        publish_locked();
        changed_.notify_all();
    }

    void close_own() {
        if (own_) own_->close();
        own_.reset();
        lose();
    }

    // No device outlives this.
    void lose() {
        // The engine may still know the device, or hang.
        if (own_) std::thread([lost = std::move(own_)] { lost->close(); }).detach();
        users_ = 0;
        grace_ns_ = 0;
        ++epoch_;
        idle();
        if (writer_) writer_->publish(status_);
    }

    void idle() {
        status_ = page::Status(options.axes, options.io_bytes, options.io_bytes);
        std::fill_n(status_.flags.begin() + vendor::SERVO_OFFLINE * options.axes, options.axes, 1);
        status_.meta.state = records::ours<EngineState::T>(EngineState::Idle);
        status_.meta.epoch = epoch_;
        status_.meta.cycle_ns = MS;
        status_.meta.error = -1;
        status_.meta.stamp_ns = now_ns();
    }

    void publish_locked() {
        std::int64_t now = now_ns();
        if (own_) {
            int code = records::our_code(own_->core.GetStatus(&theirs_));
            if (code == DEVICE_IS_NULL || (code && now - good_ns_ > LOST_NS)) return lose();
            if (code) return;  // the page ages until it is refused
            read(now);
            if (now - seen_ns_ > LOST_NS) return lose();
        }
        status_.meta.stamp_ns = own_ ? seen_ns_ : now;
        writer_->publish(status_);
    }

    void read(std::int64_t now) {
        page::Meta& meta = status_.meta;
        meta.state = records::ours<EngineState::T>(theirs_.engineState);
        if (meta.state > records::ours<EngineState::T>(EngineState::Unknown)) meta.state = records::ours<EngineState::T>(EngineState::Unknown);
        bool communicating = theirs_.engineState == EngineState::Communicating;
        // The status has no time, but its cycles are counted. They run with the bus only.
        std::int64_t counter = theirs_.cycleCounter[0];
        bool fresh = counter != counter_ || !communicating;
        counter_ = counter;
        good_ns_ = now;
        if (fresh) seen_ns_ = now;
        if (!fresh) return;
        meta.epoch = epoch_;
        meta.cycles = counter;
        meta.cycle_ns = std::llround(1e6 * theirs_.cycleTimeMilliseconds[0]);
        meta.stop = theirs_.emergencyStop;
        meta.level = records::ours<EStopLevel::T>(theirs_.emergencyStopLevel);
        for (std::size_t axis = 0; axis < options.axes; ++axis) {
            vendor::visit_status(theirs_.axesStatus[axis], ToRow{status_, axis});
            double* row = status_.reals.data() + axis;
            row[vendor::FOLLOWING_ERROR * options.axes] = row[vendor::POS_CMD * options.axes] - row[vendor::ACTUAL_POS * options.axes];
        }
        // Without a bus there are no inputs, whatever the image still contains: a contact reads as open.
        int size = static_cast<int>(options.io_bytes);
        std::fill(status_.inputs.begin(), status_.inputs.end(), 0);
        if (communicating && own_->io.GetInBytes(0, size, status_.inputs.data())) std::fill(status_.inputs.begin(), status_.inputs.end(), 0);
        if (own_->io.GetOutBytes(0, size, status_.outputs.data())) std::fill(status_.outputs.begin(), status_.outputs.end(), 0);
    }

    // The engine may end with its last device, even in motion: the axes are stopped before.
    void finish() {
        std::unique_lock lock(mutex_);
        if (!own_) return;
        for (std::size_t axis = 0; axis < options.axes; ++axis) {
            int number = static_cast<int>(axis);
            if (theirs_.axesStatus[axis].axisCommandMode == AxisCommandMode::Velocity)
                own_->core.velocity->ExecQuickStop(number);
            else
                own_->core.motion->ExecQuickStop(number);
        }
        for (std::int64_t until = now_ns() + options.stop_ms * MS; now_ns() < until && own_;) {
            publish_locked();
            auto states = status_.flags.begin() + vendor::OP_STATE * options.axes;
            if (std::all_of(states, states + options.axes, [](auto state) { return state == 0; })) break;
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
        }
    }
};

Engine* engine = nullptr;

// -- calls of the vendor's library from the arguments of a request --------------------------------------------------------

struct Request {
    std::size_t arity;
    int unfit;  // the code for a number that the argument's type cannot hold
    long (*run)(Session&, const List&, List&);
};

template <class F>
long on_axes(const Value& value, F call) {
    const List& axes = records::list(value, tables::MAX_AXES);
    AxisSelection selection;
    selection.axisCount = static_cast<int>(axes.size());
    for (std::size_t index = 0; index < axes.size(); ++index) selection.axis[index] = whole(axes[index]);
    return axes.size() == 1 ? call(selection.axis[0]) : call(&selection);
}

template <class C, class F>
long commands(const Value& value, F call) {
    const List& items = records::list(value, tables::MAX_AXES);
    std::vector<C> made(items.size() + 1);  // never without an element
    for (std::size_t index = 0; index < items.size(); ++index) Decode::decode(items[index], made[index], options.axes);
    return items.size() == 1 ? call(made.data()) : call(static_cast<unsigned>(items.size()), made.data());
}

template <class... R, class F>
long answer(List& out, F call) {
    auto results = std::make_unique<std::tuple<R...>>();
    long code = std::apply([&](auto&... one) { return call(&one...); }, *results);
    if (!code) std::apply([&](auto&... one) { (Encode{out, options.axes}(one), ...); }, *results);
    return code;
}

template <class R, class Get, class Set>
long change(const Value& value, Get get, Set set) {
    auto record = std::make_unique<R>();
    Decode::decode(value, *record, options.axes);  // wrong data must not depend on the engine's state
    long code = get(record.get());
    if (code) return code;
    Decode::decode(value, *record, options.axes);
    return set(record.get());
}

#include "generated/requests.hpp"

struct Answer {
    int code = 0;
    List values;
};

// One connection.
class Client {
public:
    explicit Client(int socket) : socket_(socket) {}

    std::atomic<bool> ended = false;
    std::thread thread;

    void cut() { shutdown(socket_, SHUT_RDWR); }

    void run() {
        try {
            serve();
        } catch (const std::exception&) {  // no frame of this protocol, or no memory for it
        }
        close(socket_);
        orphan();
        ended = true;
    }

private:
    int socket_;
    std::unique_ptr<Session> session_;

    void serve() {
        timeval limit{SEND_TIMEOUT_S, 0};
        setsockopt(socket_, SOL_SOCKET, SO_SNDTIMEO, &limit, sizeof limit);
        wire::Decoder decoder;
        char data[16384];
        while (true) {
            ssize_t count = recv(socket_, data, sizeof data, 0);
            if (count <= 0) return;
            decoder.feed(data, static_cast<std::size_t>(count));
            while (auto message = decoder.next()) {
                bool creating = !session_;
                Answer answer = execute(*message);
                if (put(message->front(), answer)) continue;
                if (creating && session_) drop();  // nobody knows of this device
                return;
            }
        }
    }

    bool put(const Value& number, Answer& answer) {
        List message{number, wire::of(answer.code)};
        std::move(answer.values.begin(), answer.values.end(), std::back_inserter(message));
        std::string frame;
        try {
            frame = wire::frame(message);
        } catch (const wire::FrameError&) {  // too long: an error of this request only
            frame = wire::frame({number, wire::of(1280)});
        }
        for (std::size_t sent = 0; sent < frame.size();) {
            ssize_t count = send(socket_, frame.data() + sent, frame.size() - sent, MSG_NOSIGNAL);
            if (count <= 0) return false;
            sent += static_cast<std::size_t>(count);
        }
        return true;
    }

    Answer execute(const List& message) {
        auto method = message[1].as<std::string>();
        List arguments(message.begin() + 2, message.end());
        if (!method) return {NO_SUPPORTED_FUNCTION, {}};
        if (session_ && session_->epoch != engine->epoch()) drop();
        auto own = OWN.find(*method);
        auto request = REQUESTS.find(*method);
        if (own == OWN.end() && request == REQUESTS.end()) return {NO_SUPPORTED_FUNCTION, {}};
        if (arguments.size() != (own == OWN.end() ? request->second.arity : own->second.arity)) return {ARGUMENT_RANGE, {}};
        if (ending) return {API_CHANNEL_ERROR, {}};
        if (!session_ && *method != "CreateDevice") return {DEVICE_IS_NULL, {}};
        Answer answer;
        try {
            if (own != OWN.end()) return (this->*own->second.run)(arguments);
            answer.code = records::our_code(request->second.run(*session_, arguments, answer.values));
        } catch (const BadArgument&) {
            answer = {ARGUMENT_RANGE, {}};
        } catch (const Unfit&) {
            answer = {own != OWN.end() ? ARGUMENT_RANGE : request->second.unfit, {}};
        }
        if (answer.code == DEVICE_IS_NULL) drop();
        engine->publish();
        return answer;
    }

    // -- requests that are more than one call -----------------------------------------------------------------------------

    struct Own {
        std::size_t arity;
        Answer (Client::*run)(const List&);
    };
    static const std::unordered_map<std::string_view, Own> OWN;

    Answer create(const List& arguments) {
        if (session_) return {RESOURCE_IN_USE, {}};
        int type = whole(arguments[0]);
        if (type < 0 || type > 3) return {ARGUMENT_RANGE, {}};
        if (int code = engine->hold()) return {code, {}};
        std::int64_t epoch = engine->epoch();
        auto made = std::make_unique<Session>();
        made->epoch = epoch;
        if (int code = made->create(named<DeviceType::T>(arguments[0]), DEVICE_MS)) {
            engine->release(epoch);
            return {code, {}};
        }
        session_ = std::move(made);
        engine->publish();
        return {0, {wire::of(session_->id()), wire::of(epoch)}};
    }

    Answer close_device(const List&) {
        int code = session_->close();
        if (code != CLOSE_LOCK) {
            std::int64_t epoch = session_->epoch;
            session_.reset();
            engine->release(epoch);
        }
        return {code, {}};
    }

    Answer stop_engine(const List&) {
        int code = records::our_code(session_->api.StopEngine(0));
        if (code == 1284) code = 0;  // it ends later
        if (!code) {
            session_.reset();
            engine->stopped();
        }
        return {code, {}};
    }

    // Without a wait the vendor's library reports a timeout and continues; the status shows when it is done.
    Answer start_communication(const List&) {
        int code = records::our_code(session_->api.StartCommunication(0));
        engine->publish();
        return {code == COMM_NOT_STARTED_IN_TIME ? 0 : code, {}};
    }

    Answer stop_communication(const List& arguments) {
        unsigned wait_ms = natural(arguments[0]);
        int code = records::our_code(session_->api.StopCommunication(wait_ms));
        engine->publish();
        return {code == COMM_NOT_STOPPED_IN_TIME && !wait_ms ? 0 : code, {}};
    }

    Answer set_name(const List& arguments) {
        std::string name = records::text(arguments[0]);
        if (name.size() >= NAME_LENGTH || name.find('\0') != name.npos) return {ARGUMENT_RANGE, {}};
        return {records::our_code(session_->api.SetDeviceName(name.data())), {}};
    }

    Answer get_name(const List&) {
        char name[NAME_LENGTH] = {};
        int code = records::our_code(session_->api.GetDeviceName(name, sizeof name));
        name[NAME_LENGTH - 1] = '\0';
        return code ? Answer{code, {}} : Answer{0, {wire::of(std::string(wire::is_utf8(name) ? name : ""))}};
    }

    Answer all_devices(const List&) {
        auto found = std::make_unique<DevicesInfoA>();
        int own_id = engine->own_id();
        if (int code = records::our_code(session_->api.GetAllDevices(found.get()))) return {code, {}};
        List devices;
        for (unsigned index = 0; index < std::min<std::size_t>(found->count, std::size(found->devices)); ++index) {
            DeviceInfoA& one = found->devices[index];
            if (static_cast<int>(one.id) == own_id) continue;
            one.name[sizeof one.name - 1] = '\0';
            Value name = wire::of(std::string(wire::is_utf8(one.name) ? one.name : ""));
            int type = records::ours<DeviceType::T>(one.type);
            devices.push_back({List{wire::of(one.id), wire::of(type), wire::of(one.watchdog), wire::of(one.watchdogCount), name}});
        }
        Value count = wire::of(static_cast<std::int64_t>(devices.size()));
        return {0, {{List{count, {std::move(devices)}}}}};
    }

    Answer scan_network(const List& arguments) {
        if (whole(arguments[0])) return {ARGUMENT_RANGE, {}};
        return {records::our_code(scan(session_->ecat)), {}};
    }

    // Versions differ in whether the call takes a master's number.
    template <class E>
    static long scan(E& ecat) {
        if constexpr (requires { ecat.ScanNetwork(0); })
            return ecat.ScanNetwork(0);
        else
            return ecat.ScanNetwork();
    }

    // The engine's present file is changed: its entries that the port does not know stay.
    Answer set_parameters(const List& arguments) {
        std::vector<double> whole = numbers(arguments[0], std::size(tables::GLOBAL_ENTRIES));
        const List& axes = records::list(arguments[1], tables::MAX_AXES);
        std::vector<std::vector<double>> of_axes;
        for (auto& one : axes) of_axes.push_back(numbers(one, std::size(tables::AXIS_ENTRIES)));
        if (of_axes.size() != options.axes) return {SETTINGS_INVALID, {}};
        std::string path = temporary();
        Answer answer = with_file([&] {
            long code = session_->core.config->GetAndExportAll(path.data());
            if (code) return records::our_code(code);
            auto root = parameter_file::read(path);
            parameter_file::set_numbers(*root->child("GlobalParameters", true), tables::GLOBAL_ENTRIES, whole);
            for (std::size_t axis = 0; axis < of_axes.size(); ++axis)
                parameter_file::set_numbers(*parameter_file::axis_block(*root, axis, true), tables::AXIS_ENTRIES, of_axes[axis]);
            parameter_file::write(path, *root);
            return records::our_code(session_->core.config->ImportAndSetAll(path.data()));
        });
        unlink(path.c_str());
        engine->publish();
        return answer;
    }

    Answer get_parameters(const List&) {
        std::string path = temporary();
        List values;
        Answer answer = with_file([&] {
            long code = session_->core.config->GetAndExportAll(path.data());
            if (code) return records::our_code(code);
            auto root = parameter_file::read(path);
            List axes;
            for (std::size_t axis = 0; axis < options.axes; ++axis)
                axes.push_back({parameter_file::numbers_of(parameter_file::axis_block(*root, axis), tables::AXIS_ENTRIES)});
            values.push_back({parameter_file::numbers_of(root->child("GlobalParameters"), tables::GLOBAL_ENTRIES)});
            values.push_back({std::move(axes)});
            return 0;
        });
        unlink(path.c_str());
        if (!answer.code) answer.values = std::move(values);
        return answer;
    }

    template <class F>
    static Answer with_file(F work) {
        try {
            return {work(), {}};
        } catch (const parameter_file::ParseError&) {
            return {PARSE_FAILED, {}};
        } catch (const std::runtime_error&) {
            return {FILE_FAILED, {}};
        }
    }

    std::string temporary() const { return options.folder + "/parameters." + std::to_string(socket_) + ".xml"; }

    static std::vector<double> numbers(const Value& value, std::size_t count) {
        std::vector<double> made;
        for (auto& one : records::list(value, count)) made.push_back(real(one));
        if (made.size() != count) throw BadArgument{};
        return made;
    }

    Answer start_spline(const List& arguments) {
        const List& axes = records::list(arguments[1], tables::MAX_AXES);
        auto positions = wire::unpack(records::text(arguments[2])), times = wire::unpack(records::text(arguments[3]));
        if (!positions || !times || positions->size() != times->size() * axes.size()) return {ARGUMENT_RANGE, {}};
        AdvMotion::PointTimeSplineCommand command;
        if (axes.size() > std::size(command.axis)) return {DIMENSION_RANGE, {}};
        command.dimensionCount = static_cast<unsigned>(axes.size());
        for (std::size_t dimension = 0; dimension < axes.size(); ++dimension) command.axis[dimension] = whole(axes[dimension]);
        std::vector<AdvMotion::SplinePoint> points(times->size() + 1);
        for (std::size_t index = 0; index < times->size(); ++index)
            std::copy_n(positions->begin() + index * axes.size(), axes.size(), points[index].pos);
        auto count = static_cast<unsigned>(times->size());
        Answer answer{spline(*session_->advanced.advMotion, whole(arguments[0]), command, count, points.data(), *times), {}};
        engine->publish();
        return answer;
    }

    // Older versions take whole milliseconds; points in the same millisecond are then refused, as the engine would.
    template <class M>
    static int spline(M& motion, int channel, AdvMotion::PointTimeSplineCommand& command, unsigned count, AdvMotion::SplinePoint* points,
                      std::vector<double>& times) {
        times.push_back(0.0);  // never without an element
        if constexpr (requires(double* exact) { motion.StartCSplinePos(channel, &command, count, points, exact); }) {
            return records::our_code(motion.StartCSplinePos(channel, &command, count, points, times.data()));
        } else {
            std::vector<unsigned> rounded;
            for (std::size_t index = 0; index < count; ++index) {
                double time = std::nearbyint(times[index]);
                if (!(time >= 0.0 && time < 4294967296.0)) return TIME_RANGE;
                if (!rounded.empty() && time <= rounded.back()) return POINTS_TOO_CLOSE;
                rounded.push_back(static_cast<unsigned>(time));
            }
            rounded.push_back(0);
            return records::our_code(motion.StartCSplinePos(channel, &command, count, points, rounded.data()));
        }
    }

    // -- the end of a device ------------------------------------------------------------------------------------------------

    void drop() {
        if (!session_) return;
        session_->close();
        std::int64_t epoch = session_->epoch;
        session_.reset();
        engine->release(epoch);
    }

    // A client that is gone without closing its device: the engine keeps it for a while, as after a crash.
    void orphan() {
        for (std::int64_t until = now_ns() + options.orphan_ms * MS; session_ && !closing && now_ns() < until;) {
            if (session_->epoch != engine->epoch()) break;
            std::this_thread::sleep_for(std::chrono::milliseconds(20));
        }
        drop();
    }
};

const std::unordered_map<std::string_view, Client::Own> Client::OWN = {
    {"CreateDevice", {1, &Client::create}},
    {"CloseDevice", {0, &Client::close_device}},
    {"StopEngine", {0, &Client::stop_engine}},
    {"StartCommunication", {0, &Client::start_communication}},
    {"SetAllParameters", {2, &Client::set_parameters}},
    {"GetAllParameters", {0, &Client::get_parameters}},
    {"StartSpline", {4, &Client::start_spline}},
    {"WMX3Api.StopCommunication", {1, &Client::stop_communication}},
    {"WMX3Api.SetDeviceName", {1, &Client::set_name}},
    {"WMX3Api.GetDeviceName", {0, &Client::get_name}},
    {"WMX3Api.GetAllDevices", {0, &Client::all_devices}},
    {"Ecat.ScanNetwork", {1, &Client::scan_network}},
};

[[noreturn]] void give_up(const std::string& why) {
    std::fprintf(stderr, "wmx_bridge: %s\n", why.c_str());
    std::exit(1);
}

void hold(const std::string& folder) {
    if (mkdir(folder.c_str(), 0700) && errno != EEXIST) give_up(folder + ": " + std::strerror(errno));
    int lock = open((folder + "/engine.lock").c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600);
    if (lock < 0) give_up(folder + ": " + std::strerror(errno));
    if (flock(lock, LOCK_EX | LOCK_NB)) give_up(folder + "/engine.lock: another motion engine runs in this folder");
}

int listen_in(const std::string& folder) {
    std::string path = folder + "/" + tables::SOCKET_FILE;
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    if (path.size() >= sizeof address.sun_path) give_up(path + ": the path of a socket is too long");
    std::copy(path.begin(), path.end(), address.sun_path);
    unlink(path.c_str());
    int listener = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    umask(0117);  // owner and group, from the first moment on
    if (bind(listener, reinterpret_cast<sockaddr*>(&address), sizeof address) || listen(listener, 64)) give_up(path + ": " + std::strerror(errno));
    umask(0077);
    return listener;
}

void serve(int listener, std::list<Client>& clients) {
    while (!ending) {
        pollfd waiting{listener, POLLIN, 0};
        poll(&waiting, 1, 100);
        for (auto one = clients.begin(); one != clients.end();) {
            if (!one->ended) {
                ++one;
                continue;
            }
            one->thread.join();
            one = clients.erase(one);
        }
        int connection = accept4(listener, nullptr, nullptr, SOCK_CLOEXEC);
        if (connection < 0) continue;
        if (clients.size() >= MAX_CLIENTS) {
            close(connection);
            continue;
        }
        clients.emplace_back(connection);
        Client& client = clients.back();
        client.thread = std::thread([&client] { client.run(); });
    }
}

std::size_t number(const char* text, std::size_t least, std::size_t greatest, const std::string& name) {
    std::size_t value = 0;
    auto [end, code] = std::from_chars(text, text + std::strlen(text), value);
    if (code != std::errc() || *end || value < least || value > greatest)
        give_up(name + " must be in " + std::to_string(least) + ".." + std::to_string(greatest) + ", is " + text);
    return value;
}

void parse(int count, char** words) {
    for (int index = 1; index < count; index += 2) {
        std::string name = words[index];
        if (index + 1 == count) give_up(name + " needs a value");
        const char* value = words[index + 1];
        if (name == "--folder") options.folder = value;
        else if (name == "--root") options.root = value;
        else if (name == "--axes") options.axes = number(value, 1, tables::MAX_AXES, name);
        else if (name == "--io-bytes") options.io_bytes = number(value, 1, LONGEST_LIST, name);
        else if (name == "--start-ms") options.start_ms = static_cast<unsigned>(number(value, 1, 600'000, name));
        else if (name == "--orphan-ms") options.orphan_ms = static_cast<int>(number(value, 0, 600'000, name));
        else if (name == "--period-us") options.period_us = static_cast<int>(number(value, 50, 100'000, name));
        else give_up("there is no option " + name);
    }
    if (options.folder.empty() || options.root.empty()) give_up("--folder and --root must be given");
}

}  // namespace

int main(int count, char** words) {
    parse(count, words);
    struct sigaction action {};
    action.sa_handler = [](int) { ending = true; };
    sigaction(SIGTERM, &action, nullptr);
    sigaction(SIGINT, &action, nullptr);
    hold(options.folder);
    try {
        Engine whole_engine;  // a client that connects finds the page
        engine = &whole_engine;
        int listener = listen_in(options.folder);
        std::thread cycle([] { engine->run(); });
        std::list<Client> clients;
        serve(listener, clients);
        cycle.join();
        closing = true;
        for (auto& one : clients) one.cut();
        for (auto& one : clients) one.thread.join();
    } catch (const std::exception& error) {
        give_up(error.what());
    }
    unlink((options.folder + "/" + tables::SOCKET_FILE).c_str());
    return 0;
}
