// The page of shared memory with the engine's status, as in robot_stack/wmx/simulated/status_memory.py.
#pragma once

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstdint>
#include <cstring>
#include <string>
#include <system_error>
#include <vector>

#include "generated/tables.hpp"

namespace page {

constexpr std::size_t HEAD_NUMBERS = 8;  // magic, layout, axes, inputs, outputs, checksum used, checksum, sequence number
constexpr std::size_t CHECKSUM = 6, SEQUENCE = 7;

struct Meta {
    std::int64_t state, epoch, cycles, stamp_ns, cycle_ns, error, stop, level, lost, overruns;
};

// One status: rows of quantities, a column for each axis.
struct Status {
    Meta meta{};
    std::size_t n_axes = 0;
    std::vector<double> reals;
    std::vector<std::int64_t> flags;
    std::vector<std::uint8_t> inputs, outputs;

    Status(std::size_t axes, std::size_t n_inputs, std::size_t n_outputs)
        : n_axes(axes), reals(tables::N_REALS * axes), flags(tables::N_FLAGS * axes), inputs(n_inputs), outputs(n_outputs) {}

    std::size_t size() const {
        return HEAD_NUMBERS * 8 + sizeof(Meta) + 8 * (reals.size() + flags.size()) + inputs.size() + outputs.size();
    }
};

inline std::uint32_t crc32(const std::uint8_t* data, std::size_t count) {
    static const auto table = [] {
        std::vector<std::uint32_t> made(256);
        for (std::uint32_t index = 0; index < 256; ++index) {
            std::uint32_t value = index;
            for (int bit = 0; bit < 8; ++bit) value = value & 1 ? 0xEDB88320u ^ value >> 1 : value >> 1;
            made[index] = value;
        }
        return made;
    }();
    std::uint32_t crc = ~0u;
    for (std::size_t at = 0; at < count; ++at) crc = table[(crc ^ data[at]) & 255] ^ crc >> 8;
    return ~crc;
}

class Mapping {
public:
    Mapping(int descriptor, std::size_t size, int protection) : size_(size) {
        bytes_ = static_cast<std::uint8_t*>(mmap(nullptr, size, protection, MAP_SHARED, descriptor, 0));
        int code = errno;
        close(descriptor);
        if (bytes_ == MAP_FAILED) throw std::system_error(code, std::generic_category(), "mmap");
    }
    ~Mapping() { munmap(bytes_, size_); }
    Mapping(const Mapping&) = delete;
    Mapping& operator=(const Mapping&) = delete;

    std::uint8_t* bytes() { return bytes_; }
    std::size_t size() const { return size_; }
    std::int64_t& head(std::size_t index) { return reinterpret_cast<std::int64_t*>(bytes_)[index]; }
    std::atomic_ref<std::int64_t> sequence() { return std::atomic_ref<std::int64_t>(head(SEQUENCE)); }

private:
    std::uint8_t* bytes_;
    std::size_t size_;
};

// Writes the page. Python's readers have no memory barrier: where loads are not in order, they verify a checksum.
class Writer {
public:
    Writer(const std::string& path, const Status& shape, mode_t mode)
        : page_(create(path, shape.size(), mode), shape.size(), PROT_READ | PROT_WRITE) {
        const std::int64_t head[] = {tables::MAGIC, tables::LAYOUT, static_cast<std::int64_t>(shape.n_axes),
                                     static_cast<std::int64_t>(shape.inputs.size()), static_cast<std::int64_t>(shape.outputs.size()),
                                     CHECKED, 0, 0};
        std::memcpy(page_.bytes(), head, sizeof head);
        publish(shape);
        if (std::rename(temporary(path).c_str(), path.c_str())) throw std::system_error(errno, std::generic_category(), path);
    }

    void publish(const Status& status) {
        sequence_ += 2;
        page_.sequence().store(sequence_ - 1, std::memory_order_relaxed);
        std::atomic_thread_fence(std::memory_order_release);
        std::uint8_t* at = page_.bytes() + HEAD_NUMBERS * 8;
        auto put = [&at](const void* data, std::size_t bytes) {
            std::memcpy(at, data, bytes);
            at += bytes;
        };
        put(&status.meta, sizeof status.meta);
        put(status.reals.data(), 8 * status.reals.size());
        put(status.flags.data(), 8 * status.flags.size());
        put(status.inputs.data(), status.inputs.size());
        put(status.outputs.data(), status.outputs.size());
        if (CHECKED) page_.head(CHECKSUM) = crc32(page_.bytes() + HEAD_NUMBERS * 8, page_.size() - HEAD_NUMBERS * 8);
        page_.sequence().store(sequence_, std::memory_order_release);
    }

private:
#if defined(__x86_64__) || defined(__i386__)
    static constexpr std::int64_t CHECKED = 0;
#else
    static constexpr std::int64_t CHECKED = 1;
#endif
    Mapping page_;
    std::int64_t sequence_ = 0;

    static std::string temporary(const std::string& path) { return path + "." + std::to_string(getpid()); }

    static int create(const std::string& path, std::size_t size, mode_t mode) {
        int descriptor = open(temporary(path).c_str(), O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, mode);
        if (descriptor < 0 || fchmod(descriptor, mode) || ftruncate(descriptor, static_cast<off_t>(size)))
            throw std::system_error(errno, std::generic_category(), temporary(path));
        return descriptor;
    }
};

}  // namespace page
