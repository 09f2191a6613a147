// Values between the wire and the vendor's types; included after the vendor's headers.
#pragma once

#include <limits>
#include <span>
#include <string>
#include <type_traits>

#include "wire.hpp"

using namespace wmx3Api;
namespace wmx3Api::ecApi {}
using namespace wmx3Api::ecApi;
#include "generated/vendor.hpp"

namespace records {

using wire::List;
using wire::Value;

// The data is not of the expected kind.
struct BadArgument {};
// A number that the argument's C++ type cannot hold.
struct Unfit {};

constexpr std::int64_t INT_LIMIT = std::int64_t{1} << 62;

inline const std::string& text(const Value& value) {
    auto found = value.as<std::string>();
    if (!found) throw BadArgument{};
    return *found;
}

inline const List& list(const Value& value, std::size_t longest) {
    auto found = value.as<List>();
    if (!found || found->size() > longest) throw BadArgument{};
    return *found;
}

template <class T>
T narrow(const Value& value) {
    auto found = value.as<std::int64_t>();
    if (!found || *found > INT_LIMIT || *found < -INT_LIMIT) throw BadArgument{};
    if (!std::in_range<T>(*found)) throw Unfit{};
    return static_cast<T>(*found);
}

inline int whole(const Value& value) { return narrow<int>(value); }
inline unsigned natural(const Value& value) { return narrow<unsigned>(value); }

inline double real(const Value& value) {
    if (auto found = value.as<double>()) return *found;
    if (auto found = value.as<std::int64_t>()) return static_cast<double>(*found);
    throw BadArgument{};
}

// -- numbers by name, as robot_stack/wmx/vendor/names.py ----------------------------------------------------------------

template <class Kind>
int theirs(int number) {
    for (auto [ours, theirs] : vendor::NAMES<Kind>)
        if (ours == number && theirs != vendor::ABSENT) return theirs;
    for (auto [ours, theirs] : vendor::NAMES<Kind>)
        if (ours == number - vendor::STRANGER) return ours;
    for (auto [ours, theirs] : vendor::NAMES<Kind>)
        if (theirs == number) return number + vendor::STRANGER;
    return number;
}

template <class Kind>
int ours(int number) {
    for (auto [ours, theirs] : vendor::NAMES<Kind>)
        if (theirs == number) return ours;
    for (auto [ours, theirs] : vendor::NAMES<Kind>)
        if (ours == number) return number + vendor::STRANGER;
    return number;
}

inline int our_code(long code) { return code ? ours<vendor::Errors>(static_cast<int>(code)) : 0; }
inline long their_code(int code) { return code ? theirs<vendor::Errors>(code) : 0; }

template <class T>
T named(const Value& value) {
    return static_cast<T>(theirs<T>(whole(value)));
}

// -- records as lists of their fields -----------------------------------------------------------------------------------

// Writes the fields of a record; arrays have an entry for each of the first n_axes axes.
struct Encode {
    List& out;
    std::size_t n_axes;

    template <class F>
    void operator()(F& field) {
        if constexpr (std::is_same_v<F, bool> || std::is_same_v<F, double>) {
            out.push_back({field});
        } else if constexpr (std::is_enum_v<F>) {
            out.push_back(wire::of(ours<F>(static_cast<int>(field))));
        } else if constexpr (std::is_same_v<F, char>) {
            out.push_back(wire::of(static_cast<int>(static_cast<signed char>(field))));  // ARM's char has no sign
        } else if constexpr (std::is_integral_v<F>) {
            out.push_back(wire::of(std::int64_t{field}));
        } else if constexpr (std::is_array_v<F>) {
            List items;
            for (std::size_t index = 0; index < n_axes; ++index) Encode{items, n_axes}(field[index]);
            out.push_back({std::move(items)});
        } else {
            List items;
            vendor::visit(field, Encode{items, n_axes});
            out.push_back({std::move(items)});
        }
    }
};

// Reads them. Throws BadArgument or Unfit.
struct Decode {
    std::span<const Value> left;
    std::size_t n_axes;

    template <class F>
    void operator()(F& field) {
        if (left.empty()) throw BadArgument{};
        const Value& value = left.front();
        left = left.subspan(1);
        if constexpr (std::is_same_v<F, bool>) {
            if (!value.as<bool>()) throw BadArgument{};
            field = *value.as<bool>();
        } else if constexpr (std::is_same_v<F, double>) {
            field = real(value);
        } else if constexpr (std::is_enum_v<F>) {
            field = named<F>(value);
        } else if constexpr (std::is_same_v<F, char>) {
            field = static_cast<char>(narrow<signed char>(value));
        } else if constexpr (std::is_integral_v<F>) {
            field = narrow<F>(value);
        } else if constexpr (std::is_array_v<F>) {
            const List& items = list(value, std::extent_v<F>);
            if (items.size() != n_axes) throw Unfit{};
            Decode entries{items, n_axes};
            for (std::size_t index = 0; index < n_axes; ++index) entries(field[index]);
        } else {
            decode(value, field, n_axes);
        }
    }

    template <class R>
    static void decode(const Value& value, R& record, std::size_t n_axes) {
        auto items = value.as<List>();
        if (!items) throw BadArgument{};
        Decode fields{*items, n_axes};
        vendor::visit(record, fields);
        if (!fields.left.empty()) throw BadArgument{};
    }
};

}  // namespace records
