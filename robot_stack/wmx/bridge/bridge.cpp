// The engine bridge: the vendor's library behind the socket and the shared memory of the simulated engine.
//
//   wmx_bridge --folder /run/wmx_bridge --root /opt/lmx/ --axes 8 --io-bytes 8
//
// Each client has a thread and a device of its own. A device of the bridge itself, with the cycle's thread, reads the status; it
// lives as long as any client's device does, so that the engine ends with the last one, and it is not shown to clients.
// A command is answered after its effect on the status is published, unless the reading of the status takes too long. No call
// waits for a motion.
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
#include <unordered_set>
#include <vector>

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


constexpr std::int64_t MS = 1'000'000;
constexpr std::int64_t LOST_NS = 2000 * MS;      // without a new status while the bus runs or calls fail, the engine is lost
constexpr std::int64_t GRACE_NS = 15'000 * MS;   // the engine is kept for clients whose creation of a device timed out
constexpr auto CREATION_WAIT = std::chrono::milliseconds(300);  // below the clients' own timeout
constexpr auto PUBLISH_WAIT = std::chrono::milliseconds(50);    // of a command for its effect on the status
constexpr unsigned DEVICE_MS = 500;  // for a further device of a running engine, below the clients' own timeout
constexpr std::size_t MAX_CLIENTS = 64, NAME_LENGTH = 64, LONGEST_LIST = 8000;
constexpr int CLOSE_TRIES = 20, SEND_TIMEOUT_S = 1;
constexpr auto CLOSE_PAUSE = std::chrono::milliseconds(20);
constexpr auto END_WAIT = std::chrono::milliseconds(500);  // for calls in progress when the bridge ends

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
std::atomic<bool> closed = false;   // the clients' are: the bridge's own follows

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
            if (code != codes::CloseDeviceLockError) break;
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

// Quick-stops every axis until all of them stand in two cycles: a command may not be in the status yet. False without a status.
bool stop_axes(Session& session) {
    auto status = std::make_unique<CoreMotionStatus>();
    std::int64_t counter = -1;
    int standing = 0;
    for (std::int64_t until = now_ns() + options.stop_ms * MS; now_ns() < until && standing < 2;) {
        if (session.core.GetStatus(status.get())) return false;
        if (status->engineState != EngineState::Communicating) return true;
        bool moving = false;
        for (std::size_t axis = 0; axis < options.axes; ++axis) {
            if (status->axesStatus[axis].opState == OperationState::Idle) continue;
            moving = true;
            int number = static_cast<int>(axis);
            if (status->axesStatus[axis].axisCommandMode == AxisCommandMode::Velocity)
                session.core.velocity->ExecQuickStop(number);
            else
                session.core.motion->ExecQuickStop(number);
        }
        std::int64_t cycle = status->cycleCounter[0];
        if (moving) standing = 0;
        else if (cycle != counter) ++standing;
        counter = cycle;
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return true;
}

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

// The bridge's own device and the status page. Only the cycle's thread calls the library here: a call that hangs never blocks a
// client's command. The lock is never held during one.
class Engine {
public:
    Engine() : status_(options.axes, options.io_bytes, options.io_bytes) {
        epoch_ = now_ns();  // invalidates the devices of an earlier bridge
        idle();
        writer_ = std::make_unique<page::Writer>(options.folder + "/" + tables::STATUS_FILE, status_, 0640);
    }

    // Keeps the engine for one more client. 0 and the epoch of its device, or why there is none yet.
    int hold(std::int64_t& epoch) {
        std::unique_lock lock(mutex_);
        if (!ready_) {
            grace_ns_ = now_ns() + GRACE_NS;
            wanted_ = true;
            failure_ = codes::EngineNotStartedInSpecifiedTime;
            asking_.notify_all();
            changed_.wait_for(lock, CREATION_WAIT, [this] { return ready_ || !wanted_; });
            if (!ready_) return failure_;
        }
        ++users_;
        epoch = epoch_;
        return 0;
    }

    std::int64_t epoch() const { return epoch_; }

    // A client's device is closed. The bridge's own one is closed with the last.
    void release(std::int64_t epoch) {
        {
            std::lock_guard lock(mutex_);
            if (epoch != epoch_ || users_ == 0) return;
            grace_ns_ = 0;
            --users_;
        }
        publish();
    }

    // A client's device was not created: it tries again, and the engine must not end meanwhile.
    void give_back(std::int64_t epoch) {
        std::lock_guard lock(mutex_);
        if (epoch != epoch_ || users_ == 0) return;
        grace_ns_ = now_ns() + GRACE_NS;
        --users_;
    }

    // A client has stopped the engine for all.
    void stopped() {
        {
            std::lock_guard lock(mutex_);
            if (ready_) forget();
        }
        publish();
    }

    int own_id() const { return own_id_; }

    // Has the present status published, so that the answer to a command does not come before its effect. If the library takes too
    // long for it, the page ages until clients refuse it, and commands do not wait.
    void publish() {
        std::unique_lock lock(mutex_);
        std::uint64_t mine = ++asked_;
        asking_.notify_all();
        if (!late_) late_ = !changed_.wait_for(lock, PUBLISH_WAIT, [&] { return served_ >= mine; });
    }

    // Stops the axes with the own device, or with another if that was lost. Returns without it if that hangs.
    void stop() {
        std::unique_lock lock(mutex_);
        stop_ = true;
        asking_.notify_all();
        changed_.wait_for(lock, std::chrono::milliseconds(options.stop_ms) + END_WAIT, [this] { return !stop_; });
    }

    void run() {
        const auto period = std::chrono::microseconds(options.period_us);
        auto due = std::chrono::steady_clock::now();
        while (!closed) {
            auto now = std::chrono::steady_clock::now();
            if (due <= now) due = std::max(due + period, now + period / 2);  // never without a pause
            bool opening, closing_own, stopping;
            {
                std::unique_lock lock(mutex_);
                asking_.wait_until(lock, due, [this] { return asked_ != served_; });
                if (ready_ && !users_ && now_ns() > grace_ns_) forget();
                opening = wanted_ && !own_;
                closing_own = own_ && !ready_;
                stopping = stop_;
            }
            if (closing_own) close_own();
            if (opening) open();
            if (stopping) {
                stop_now();
                std::lock_guard lock(mutex_);
                stop_ = false;
            }
            serve();
        }
        if (own_) own_->close();
        ended_ = true;
    }

    bool ended() const { return ended_; }

private:
    std::mutex mutex_;
    std::condition_variable changed_, asking_;
    // Under the lock.
    std::size_t users_ = 0;
    bool ready_ = false, wanted_ = false, stop_ = false, late_ = false;
    int failure_ = 0;
    std::int64_t grace_ns_ = 0;
    std::uint64_t asked_ = 0, served_ = 0;
    std::atomic<std::int64_t> epoch_ = 0;
    std::atomic<int> own_id_ = 0;
    std::atomic<bool> ended_ = false;
    // Of the cycle's thread.
    std::unique_ptr<Session> own_;
    std::unique_ptr<page::Writer> writer_;
    page::Status status_;
    CoreMotionStatus theirs_;
    bool lost_ = false;
    std::int64_t counter_ = -1, seen_ns_ = 0, good_ns_ = 0;

    // No device outlives this. With the lock.
    void forget() {
        ready_ = false;
        users_ = 0;
        grace_ns_ = 0;
        own_id_ = 0;
        ++epoch_;
    }

    // The first device starts the engine, which takes seconds: in another thread, so that the page stays fresh.
    void open() {
        auto made = std::make_unique<Session>();
        int code = codes::EngineNotStartedInSpecifiedTime;
        std::atomic<bool> done = false;
        try {
            std::thread creation([&] {
                code = made->create(DeviceType::DeviceTypeNormal, options.start_ms);
                char name[] = "wmx_bridge";
                if (!code) made->api.SetDeviceName(name);
                done = true;
            });
            while (!done) {
                serve();
                std::this_thread::sleep_for(std::chrono::milliseconds(1));
            }
            creation.join();
        } catch (const std::system_error&) {  // no thread: the client tries again
        }
        {
            int id = code ? 0 : made->id();
            std::lock_guard lock(mutex_);
            wanted_ = false;
            failure_ = code;
            ready_ = !code;
            own_id_ = id;
        }
        if (!code) {
            own_ = std::move(made);
            lost_ = false;
        }
        counter_ = -1;
        good_ns_ = now_ns();
        changed_.notify_all();
    }

    // If the lost engine has ended, the device starts another, which ends with it.
    void stop_now() {
        if (own_ || !lost_) {
            if (own_) stop_axes(*own_);
            return;
        }
        Session spare;
        if (!spare.create(DeviceType::DeviceTypeNormal, DEVICE_MS)) stop_axes(spare);
        spare.close();
    }

    void close_own() {
        own_->close();
        own_.reset();
        idle();
    }

    // The engine may still know the device, or hang.
    void lose() {
        {
            std::lock_guard lock(mutex_);
            if (ready_) forget();
        }
        lost_ = true;
        Session* lost = own_.release();
        try {
            std::thread([lost] {
                lost->close();
                delete lost;
            }).detach();
        } catch (const std::system_error&) {  // the vendor's watchdog closes it
        }
        idle();
        writer_->publish(status_);
    }

    // Publishes the present status, and tells those that wait for it.
    void serve() {
        std::uint64_t asked;
        {
            std::lock_guard lock(mutex_);
            asked = asked_;
        }
        read_and_write();
        {
            std::lock_guard lock(mutex_);
            served_ = asked;
            late_ = false;
        }
        changed_.notify_all();
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

    void read_and_write() {
        std::int64_t now = now_ns();
        if (own_) {
            int code = records::our_code(own_->core.GetStatus(&theirs_));
            if (code == codes::DeviceIsNull || (code && now - good_ns_ > LOST_NS)) return lose();
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
};

Engine* engine = nullptr;

// An argument that does not reach the vendor's library, and its code.
struct Refused {
    int code;
};

// -- calls of the vendor's library from the arguments of a request --------------------------------------------------------

struct Request {
    std::size_t arity;
    int unfit;  // the code for a number that the argument's type cannot hold
    long (*run)(Session&, const List&, List&);
};

// The status has no others, and they are not stopped when the bridge ends.
int checked_axis(int axis) {
    if (axis < 0 || static_cast<std::size_t>(axis) >= options.axes) throw Refused{codes::AxisOutOfRange};
    return axis;
}

// The vendor does not document what it does with NaN or an infinity.
double checked(double number, int code) {
    if (!std::isfinite(number)) throw Refused{code};
    return number;
}

double finite(const Value& value, int code) { return checked(real(value), code); }

template <class C>
void check(const C& command) {
    checked_axis(command.axis);
    const Profile& profile = command.profile;
    checked(profile.startingVelocity, codes::StartingVelocityArgumentOutOfRange);
    checked(profile.endVelocity, codes::EndVelocityArgumentOutOfRange);
    checked(profile.velocity, codes::VelocityArgumentOutOfRange);
    checked(profile.acc, codes::AccArgumentOutOfRange);
    checked(profile.dec, codes::DecArgumentOutOfRange);
    checked(profile.accTimeMilliseconds, codes::TimeArgumentOutOfRange);
    checked(profile.decTimeMilliseconds, codes::TimeArgumentOutOfRange);
    if constexpr (requires { command.target; }) checked(command.target, codes::PositionArgumentOutOfRange);
    if constexpr (requires { command.runTimeMilliseconds; }) checked(command.runTimeMilliseconds, codes::RunTimeArgumentOutOfRange);
}

// A parameter block.
struct CheckBlock {
    template <class F>
    void operator()(const F& field) {
        if constexpr (std::is_same_v<F, double>)
            checked(field, codes::ParameterSettingsInvalid);
        else if constexpr (std::is_array_v<F>)
            for (std::size_t axis = 0; axis < options.axes; ++axis) (*this)(field[axis]);
    }
};

template <class F>
long on_axes(const Value& value, F call) {
    const List& axes = records::list(value, tables::MAX_AXES);
    AxisSelection selection;
    selection.axisCount = static_cast<int>(axes.size());
    for (std::size_t index = 0; index < axes.size(); ++index) selection.axis[index] = checked_axis(whole(axes[index]));
    return axes.size() == 1 ? call(selection.axis[0]) : call(&selection);
}

template <class C, class F>
long commands(const Value& value, F call) {
    const List& items = records::list(value, tables::MAX_AXES);
    std::vector<C> made(items.size() + 1);  // never without an element
    for (std::size_t index = 0; index < items.size(); ++index) Decode::decode(items[index], made[index], options.axes);
    for (auto& one : made) check(one);
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
    vendor::visit(*record, CheckBlock{});
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

    ~Client() { close(socket_); }
    Client(const Client&) = delete;
    Client& operator=(const Client&) = delete;

    std::atomic<bool> ended = false;
    std::thread thread;
    std::timed_mutex busy;  // held for every use of the device

    // With busy. False without a device that answers.
    bool stop() { return session_ && stop_axes(*session_); }

    void cut() { shutdown(socket_, SHUT_RDWR); }

    void run() {
        try {
            serve();
        } catch (const std::exception&) {  // no frame of this protocol, or no memory for it
        }
        cut();
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
            if (count < 0 && errno == EINTR) continue;
            if (count <= 0) return;
            decoder.feed(data, static_cast<std::size_t>(count));
            while (auto message = decoder.next()) {
                bool creating = !session_;
                Answer answer;
                {
                    std::lock_guard lock(busy);
                    answer = execute(*message, decoder);
                }
                if (put(message->front(), answer)) continue;
                std::lock_guard lock(busy);
                if (creating) drop();  // nobody knows of this device
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
            if (count < 0 && errno == EINTR) continue;
            if (count <= 0) return false;
            sent += static_cast<std::size_t>(count);
        }
        return true;
    }

    // The client waits no longer for the answer: it is gone, or has sent another request.
    bool given_up(const wire::Decoder& decoder) const {
        pollfd state{socket_, POLLIN | POLLRDHUP, 0};
        return decoder.pending() || poll(&state, 1, 0) > 0;
    }

    static bool moves(const std::string& method, const List& arguments) {
        if (method == "axisControl.SetServoOn") return !arguments[1].as<std::int64_t>() || *arguments[1].as<std::int64_t>();
        return MOVING.contains(method);
    }

    Answer execute(const List& message, const wire::Decoder& decoder) {
        auto method = message[1].as<std::string>();
        List arguments(message.begin() + 2, message.end());
        if (!method) return {codes::NoSupportedFunction, {}};
        if (session_ && session_->epoch != engine->epoch()) drop();
        auto own = OWN.find(*method);
        auto request = REQUESTS.find(*method);
        if (own == OWN.end() && request == REQUESTS.end()) return {codes::NoSupportedFunction, {}};
        if (arguments.size() != (own == OWN.end() ? request->second.arity : own->second.arity)) return {codes::ArgumentOutOfRange, {}};
        if (ending) return {codes::APIChannelError, {}};
        if (!session_ && *method != "CreateDevice") return {codes::DeviceIsNull, {}};
        if (moves(*method, arguments) && given_up(decoder)) return {codes::APIChannelTimeOut, {}};
        Answer answer;
        try {
            if (own != OWN.end()) return (this->*own->second.run)(arguments);
            answer.code = records::our_code(request->second.run(*session_, arguments, answer.values));
        } catch (const BadArgument&) {
            answer = {codes::ArgumentOutOfRange, {}};
        } catch (const Refused& refused) {
            answer = {refused.code, {}};
        } catch (const Unfit&) {
            answer = {own != OWN.end() ? codes::ArgumentOutOfRange : request->second.unfit, {}};
        }
        if (answer.code == codes::DeviceIsNull) drop();
        engine->publish();
        return answer;
    }

    // -- requests that are more than one call -----------------------------------------------------------------------------

    struct Own {
        std::size_t arity;
        Answer (Client::*run)(const List&);
    };
    static const std::unordered_map<std::string_view, Own> OWN;
    static const std::unordered_set<std::string_view> MOVING;

    Answer create(const List& arguments) {
        if (session_) return {codes::ResourceInUse, {}};
        int type = whole(arguments[0]);
        if (type < 0 || type > 3) return {codes::ArgumentOutOfRange, {}};
        DeviceType::T kind = named<DeviceType::T>(arguments[0]);
        std::int64_t epoch = 0;
        if (int code = engine->hold(epoch)) return {code, {}};
        auto made = std::make_unique<Session>();
        made->epoch = epoch;
        if (int code = made->create(kind, DEVICE_MS)) {
            made->close();  // it may exist by then
            engine->give_back(epoch);
            return {code, {}};
        }
        session_ = std::move(made);
        engine->publish();
        return {0, {wire::of(session_->id()), wire::of(epoch)}};
    }

    Answer close_device(const List&) {
        int code = session_->close();
        if (code != codes::CloseDeviceLockError) {
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
        return {code == codes::CommNotStartedInSpecifiedTime ? 0 : code, {}};
    }

    Answer stop_communication(const List& arguments) {
        unsigned wait_ms = natural(arguments[0]);
        int code = records::our_code(session_->api.StopCommunication(wait_ms));
        engine->publish();
        return {code == codes::CommNotStoppedInSpecifiedTime && !wait_ms ? 0 : code, {}};
    }

    Answer set_name(const List& arguments) {
        std::string name = records::text(arguments[0]);
        if (name.size() >= NAME_LENGTH || name.find('\0') != name.npos) return {codes::ArgumentOutOfRange, {}};
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
        if (whole(arguments[0])) return {codes::ArgumentOutOfRange, {}};
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
        if (of_axes.size() != options.axes) return {codes::ParameterSettingsInvalid, {}};
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
            return {codes::ParameterFileParseError, {}};
        } catch (const std::runtime_error&) {
            return {codes::FileOperationFailed, {}};
        }
    }

    std::string temporary() const { return options.folder + "/parameters." + std::to_string(socket_) + ".xml"; }

    static std::vector<double> numbers(const Value& value, std::size_t count) {
        std::vector<double> made;
        for (auto& one : records::list(value, count)) made.push_back(finite(one, codes::ParameterSettingsInvalid));
        if (made.size() != count) throw BadArgument{};
        return made;
    }

    Answer start_spline(const List& arguments) {
        const List& axes = records::list(arguments[1], tables::MAX_AXES);
        auto positions = wire::unpack(records::text(arguments[2])), times = wire::unpack(records::text(arguments[3]));
        if (!positions || !times || positions->size() != times->size() * axes.size()) return {codes::ArgumentOutOfRange, {}};
        for (double one : *positions) checked(one, codes::PositionArgumentOutOfRange);
        for (double one : *times) checked(one, codes::TimeArgumentOutOfRange);
        AdvMotion::PointTimeSplineCommand command;
        if (axes.size() > std::size(command.axis)) return {codes::DimensionOutOfRange, {}};
        command.dimensionCount = static_cast<unsigned>(axes.size());
        for (std::size_t dimension = 0; dimension < axes.size(); ++dimension) command.axis[dimension] = checked_axis(whole(axes[dimension]));
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
                if (!(time >= 0.0 && time < 4294967296.0)) return codes::TimeArgumentOutOfRange;
                if (!rounded.empty() && time <= rounded.back()) return codes::TimeBetweenPointsTooClose;
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
        std::lock_guard lock(busy);
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

// Commands that must not be executed late, when another client may have stopped the robot; also servos on, see moves.
const std::unordered_set<std::string_view> Client::MOVING = {
    "CoreMotion.ReleaseEStop", "StartSpline",     "home.StartHome", "motion.StartMov", "motion.StartPos",
    "velocity.StartVel",       "velocity.StartVel_TimedVel",
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
        if (connection < 0) {
            if (errno != EAGAIN && errno != EINTR) std::this_thread::sleep_for(std::chrono::milliseconds(100));  // no descriptor is free
            continue;
        }
        if (clients.size() >= MAX_CLIENTS) {
            close(connection);
            continue;
        }
        clients.emplace_back(connection);
        Client& client = clients.back();
        try {
            client.thread = std::thread([&client] { client.run(); });
        } catch (const std::system_error&) {  // no thread is free
            clients.pop_back();
        }
    }
}

// The engine may end with its last device, even in motion: the axes are stopped before. No command is executed any more.
void stop_all(std::list<Client>& clients) {
    std::vector<std::unique_lock<std::timed_mutex>> locks;
    bool done = false;
    auto until = std::chrono::steady_clock::now() + END_WAIT;
    for (auto& one : clients) locks.emplace_back(one.busy, until);
    auto lock = locks.begin();
    for (auto& one : clients)
        if ((lock++)->owns_lock() && !done) done = one.stop();
    if (!done) engine->stop();
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
    sigaction(SIGHUP, &action, nullptr);
    signal(SIGPIPE, SIG_IGN);
    hold(options.folder);
    try {
        Engine whole_engine;  // a client that connects finds the page
        engine = &whole_engine;
        int listener = listen_in(options.folder);
        std::thread cycle([] { engine->run(); });
        std::list<Client> clients;
        serve(listener, clients);
        stop_all(clients);
        closing = true;
        for (auto& one : clients) one.cut();
        for (auto& one : clients) one.thread.join();
        closed = true;
        for (int waited = 0; waited < 2000 && !engine->ended(); ++waited) std::this_thread::sleep_for(std::chrono::milliseconds(1));
        if (!engine->ended()) {
            std::fputs("wmx_bridge: the engine does not answer\n", stderr);
            std::_Exit(1);
        }
        cycle.join();
    } catch (const std::exception& error) {
        give_up(error.what());
    }
    unlink((options.folder + "/" + tables::SOCKET_FILE).c_str());
    return 0;
}
