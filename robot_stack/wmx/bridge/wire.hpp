// The wire between clients and the engine, as in robot_stack/wmx/simulated/protocol.py: frames of JSON.
#pragma once

#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "generated/tables.hpp"

namespace wire {

constexpr std::size_t LENGTH_BYTES = 4;
constexpr int DEEPEST = 32;

// The bytes are no frame of this protocol; the rest of the stream is invalid.
struct FrameError : std::runtime_error {
    using std::runtime_error::runtime_error;
};

// Null, or an object: valid JSON, but of no use as an argument.
struct Other {};

struct Value;
using List = std::vector<Value>;

struct Value {
    std::variant<Other, bool, std::int64_t, double, std::string, List> held;

    template <class T>
    const T* as() const {
        return std::get_if<T>(&held);
    }
};

inline Value of(bool value) { return {value}; }
inline Value of(double value) { return {value}; }
inline Value of(std::int64_t value) { return {value}; }
inline Value of(int value) { return {std::int64_t{value}}; }
inline Value of(unsigned value) { return {std::int64_t{value}}; }
inline Value of(std::string value) { return {std::move(value)}; }
inline Value of(List value) { return {std::move(value)}; }

class Parser {
public:
    explicit Parser(std::string_view text) : at_(text.data()), end_(text.data() + text.size()) {}

    Value whole() {
        Value value = next(0);
        space();
        if (at_ != end_) fail();
        return value;
    }

private:
    const char* at_;
    const char* end_;

    [[noreturn]] static void fail() { throw FrameError("a frame's body must be JSON"); }

    void space() {
        while (at_ != end_ && (*at_ == ' ' || *at_ == '\t' || *at_ == '\n' || *at_ == '\r')) ++at_;
    }

    bool take(std::string_view text) {
        if (static_cast<std::size_t>(end_ - at_) < text.size() || std::string_view(at_, text.size()) != text) return false;
        at_ += text.size();
        return true;
    }

    void need(std::string_view text) {
        if (!take(text)) fail();
    }

    Value next(int depth) {
        space();
        if (at_ == end_ || depth > DEEPEST) fail();
        switch (*at_) {
            case '"': return {text()};
            case '[': return {list(depth)};
            case '{': return object(depth);
            case 't': need("true"); return {true};
            case 'f': need("false"); return {false};
            case 'n': need("null"); return {Other{}};
            default: return number();
        }
    }

    List list(int depth) {
        List items;
        need("[");
        space();
        if (take("]")) return items;
        do {
            items.push_back(next(depth + 1));
            space();
        } while (take(","));
        need("]");
        return items;
    }

    Value object(int depth) {
        need("{");
        space();
        if (take("}")) return {Other{}};
        do {
            space();
            text();
            space();
            need(":");
            next(depth + 1);
            space();
        } while (take(","));
        need("}");
        return {Other{}};
    }

    // Python's JSON has NaN and the infinities. An integer beyond 64 bits is kept as a real number, which no integer is.
    Value number() {
        if (take("NaN")) return {std::nan("")};
        if (take("Infinity")) return {HUGE_VAL};
        if (take("-Infinity")) return {-HUGE_VAL};
        const char* start = at_;
        bool real = false;
        if (at_ != end_ && *at_ == '-') ++at_;
        const char* digits = at_;
        while (at_ != end_ && std::strchr("0123456789.eE+-", *at_) != nullptr && *at_ != '\0') {
            real = real || *at_ == '.' || *at_ == 'e' || *at_ == 'E';
            ++at_;
        }
        if (digits == at_ || *digits < '0' || *digits > '9' || (*digits == '0' && at_ - digits > 1 && digits[1] >= '0' && digits[1] <= '9')) fail();
        std::int64_t whole = 0;
        if (!real) {
            auto [last, code] = std::from_chars(start, at_, whole);
            if (code == std::errc() && last == at_) return {whole};
            if (code != std::errc::result_out_of_range || last != at_) fail();
        }
        double value = 0.0;
        auto [last, code] = std::from_chars(start, at_, value);
        if (last != at_ || code == std::errc::invalid_argument) fail();
        return {value};
    }

    unsigned hex4() {
        if (end_ - at_ < 4) fail();
        unsigned value = 0;
        auto [last, code] = std::from_chars(at_, at_ + 4, value, 16);
        if (code != std::errc() || last != at_ + 4) fail();
        at_ += 4;
        return value;
    }

    static void utf8(std::string& out, unsigned point) {
        if (point < 0x80) {
            out += static_cast<char>(point);
        } else if (point < 0x800) {
            out += {static_cast<char>(0xC0 | point >> 6), static_cast<char>(0x80 | (point & 63))};
        } else if (point < 0x10000) {
            out += {static_cast<char>(0xE0 | point >> 12), static_cast<char>(0x80 | (point >> 6 & 63)),
                    static_cast<char>(0x80 | (point & 63))};
        } else {
            out += {static_cast<char>(0xF0 | point >> 18), static_cast<char>(0x80 | (point >> 12 & 63)),
                    static_cast<char>(0x80 | (point >> 6 & 63)), static_cast<char>(0x80 | (point & 63))};
        }
    }

    std::string text() {
        std::string out;
        need("\"");
        while (true) {
            if (at_ == end_ || static_cast<unsigned char>(*at_) < 0x20) fail();
            char letter = *at_++;
            if (letter == '"') return out;
            if (letter != '\\') {
                out += letter;
                continue;
            }
            if (at_ == end_) fail();
            static constexpr std::string_view SHORT = "\"\\/bfnrt", MEANT = "\"\\/\b\f\n\r\t";
            letter = *at_++;
            if (auto found = SHORT.find(letter); found != SHORT.npos) {
                out += MEANT[found];
            } else if (letter == 'u') {
                unsigned point = hex4();
                if (point >= 0xD800 && point < 0xDC00 && take("\\u")) {
                    unsigned low = hex4();
                    if (low < 0xDC00 || low > 0xDFFF) fail();
                    point = 0x10000 + ((point - 0xD800) << 10) + (low - 0xDC00);
                } else if (point >= 0xD800 && point < 0xE000) {
                    fail();  // half a pair is no character
                }
                utf8(out, point);
            } else {
                fail();
            }
        }
    }
};

inline bool is_utf8(std::string_view text) {
    for (std::size_t at = 0; at < text.size();) {
        unsigned char first = text[at];
        std::size_t more = first < 0x80 ? 0 : first < 0xC2 ? 9 : first < 0xE0 ? 1 : first < 0xF0 ? 2 : first < 0xF5 ? 3 : 9;
        if (more >= text.size() - at) return false;
        for (std::size_t index = 1; index <= more; ++index)
            if ((static_cast<unsigned char>(text[at + index]) & 0xC0) != 0x80) return false;
        at += more + 1;
    }
    return true;
}

inline void write(std::string& out, const Value& value);

inline void write(std::string& out, const List& items) {
    out += '[';
    for (std::size_t index = 0; index < items.size(); ++index) {
        if (index) out += ',';
        write(out, items[index]);
    }
    out += ']';
}

inline void write_real(std::string& out, double value) {
    if (std::isnan(value)) {
        out += "NaN";
    } else if (std::isinf(value)) {
        out += value < 0.0 ? "-Infinity" : "Infinity";
    } else {
        char text[32];
        auto [end, code] = std::to_chars(text, text + sizeof text, value);
        std::string_view written(text, end - text);
        out += written;
        if (written.find_first_of(".e") == written.npos) out += ".0";  // stays a real number for the reader
    }
}

inline void write(std::string& out, const Value& value) {
    if (auto flag = value.as<bool>()) {
        out += *flag ? "true" : "false";
    } else if (auto whole = value.as<std::int64_t>()) {
        out += std::to_string(*whole);
    } else if (auto real = value.as<double>()) {
        write_real(out, *real);
    } else if (auto items = value.as<List>()) {
        write(out, *items);
    } else if (auto text = value.as<std::string>()) {
        out += '"';
        for (char letter : *text) {
            if (letter == '"' || letter == '\\') {
                out += {'\\', letter};
            } else if (static_cast<unsigned char>(letter) < 0x20) {
                static constexpr char DIGITS[] = "0123456789abcdef";
                out += {'\\', 'u', '0', '0', DIGITS[letter >> 4], DIGITS[letter & 15]};
            } else {
                out += letter;
            }
        }
        out += '"';
    } else {
        out += "null";
    }
}

// One frame. Throws FrameError if it is too long.
inline std::string frame(const List& message) {
    std::string out(LENGTH_BYTES, '\0');
    write(out, message);
    std::size_t length = out.size() - LENGTH_BYTES;
    if (length > tables::LARGEST_FRAME) throw FrameError("the frame is too long");
    for (std::size_t byte = 0; byte < LENGTH_BYTES; ++byte) out[byte] = static_cast<char>(length >> 8 * byte);
    return out;
}

// Cuts a stream of bytes into messages, however the bytes arrive.
class Decoder {
public:
    void feed(const char* data, std::size_t count) { buffer_.append(data, count); }

    // There are bytes behind the last message.
    bool pending() const { return !buffer_.empty(); }

    // The next complete message. Throws FrameError.
    std::optional<List> next() {
        if (buffer_.size() < LENGTH_BYTES) return {};
        std::size_t length = 0;
        for (std::size_t byte = 0; byte < LENGTH_BYTES; ++byte)
            length |= std::size_t{static_cast<unsigned char>(buffer_[byte])} << 8 * byte;
        if (!length || length > tables::LARGEST_FRAME) throw FrameError("the length of a frame is out of range");
        if (buffer_.size() < LENGTH_BYTES + length) return {};
        std::string body = buffer_.substr(LENGTH_BYTES, length);
        buffer_.erase(0, LENGTH_BYTES + length);
        if (!is_utf8(body)) throw FrameError("a frame's body must be UTF-8");
        Value message = Parser(body).whole();
        auto items = std::get_if<List>(&message.held);
        if (!items || items->size() < 2 || !items->front().as<std::int64_t>())
            throw FrameError("a frame's body must be a list that begins with a number");
        return std::move(*items);
    }

private:
    std::string buffer_;
};

constexpr std::string_view BASE64 = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

// Numbers as base64 of little-endian float64; both ends of a local socket have one byte order.
inline std::string pack(const std::vector<double>& numbers) {
    std::string bytes(numbers.size() * sizeof(double), '\0');
    if (!numbers.empty()) std::memcpy(bytes.data(), numbers.data(), bytes.size());
    std::string out;
    for (std::size_t at = 0; at < bytes.size(); at += 3) {
        std::uint32_t three = 0;
        for (std::size_t index = 0; index < 3; ++index)
            three = three << 8 | (at + index < bytes.size() ? static_cast<unsigned char>(bytes[at + index]) : 0);
        for (std::size_t index = 0; index < 4; ++index)
            out += at + index <= bytes.size() ? BASE64[three >> (18 - 6 * index) & 63] : '=';
    }
    return out;
}

// The numbers of pack; none for a text that is no such numbers.
inline std::optional<std::vector<double>> unpack(std::string_view text) {
    if (text.size() % 4) return {};
    std::string bytes;
    for (std::size_t at = 0; at < text.size(); at += 4) {
        std::uint32_t three = 0;
        int missing = 0;
        for (std::size_t index = 0; index < 4; ++index) {
            char letter = text[at + index];
            auto found = BASE64.find(letter);
            bool padding = letter == '=' && at + 4 == text.size() && index >= 2;
            if ((found == BASE64.npos && !padding) || (missing && !padding)) return {};
            missing += padding;
            three = three << 6 | (padding ? 0 : static_cast<std::uint32_t>(found));
        }
        for (int index = 0; index < 3 - missing; ++index) bytes += static_cast<char>(three >> (16 - 8 * index));
    }
    if (bytes.size() % sizeof(double)) return {};
    std::vector<double> numbers(bytes.size() / sizeof(double));
    if (!numbers.empty()) std::memcpy(numbers.data(), bytes.data(), bytes.size());
    return numbers;
}

}  // namespace wire
