// The vendor's parameter file, as in robot_stack/wmx/simulated/parameter_file.py: a tree of tags with numbers.
//
// A file of the vendor's is read, the port's entries in it are changed, and it is written: other entries stay.
#pragma once

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "generated/tables.hpp"
#include "wire.hpp"

namespace parameter_file {

struct ParseError : std::runtime_error {
    using std::runtime_error::runtime_error;
};

struct Element {
    std::string name, attributes, text;
    std::vector<std::unique_ptr<Element>> children;

    Element* child(std::string_view wanted, bool make = false) {
        for (auto& one : children)
            if (one->name == wanted) return one.get();
        if (!make) return nullptr;
        children.push_back(std::make_unique<Element>());
        children.back()->name = wanted;
        return children.back().get();
    }

    // The element at a path of names with slashes.
    Element* at(std::string_view path, bool make = false) {
        auto slash = path.find('/');
        Element* next = child(path.substr(0, slash), make);
        return next && slash != path.npos ? next->at(path.substr(slash + 1), make) : next;
    }

    std::optional<std::string> attribute(std::string_view wanted) const {
        std::string mark = " " + std::string(wanted) + "=\"";
        auto start = (" " + attributes).find(mark);
        if (start == std::string::npos) return {};
        start += mark.size() - 1;
        return attributes.substr(start, attributes.find('"', start) - start);
    }
};

class Reader {
public:
    explicit Reader(std::string_view text) : text_(text) {}

    std::unique_ptr<Element> whole() {
        skip();
        auto root = element(0);
        skip();
        if (at_ != text_.size()) fail();
        return root;
    }

private:
    std::string_view text_;
    std::size_t at_ = 0;

    [[noreturn]] static void fail() { throw ParseError("no parameter file"); }

    bool starts(std::string_view mark) const { return text_.substr(at_, mark.size()) == mark; }

    std::string_view until(std::string_view mark) {
        auto end = text_.find(mark, at_);
        if (end == text_.npos) fail();
        auto taken = text_.substr(at_, end - at_);
        at_ = end + mark.size();
        return taken;
    }

    // Space, the declaration and comments; a document type or an entity is none of these.
    void skip() {
        while (at_ < text_.size()) {
            if (std::string_view(" \t\r\n").find(text_[at_]) != std::string_view::npos) {
                ++at_;
            } else if (starts("<?")) {
                until("?>");
            } else if (starts("<!--")) {
                until("-->");
            } else {
                return;
            }
        }
    }

    std::unique_ptr<Element> element(int depth) {
        if (depth > 6 || !starts("<") || starts("<!")) fail();
        ++at_;
        std::string_view tag = until(">");
        bool empty = tag.ends_with('/');
        if (empty) tag.remove_suffix(1);
        auto made = std::make_unique<Element>();
        auto space = tag.find_first_of(" \t\r\n");
        made->name = tag.substr(0, space);
        if (made->name.empty()) fail();
        if (space != tag.npos) made->attributes = tag.substr(std::min(tag.find_first_not_of(" \t\r\n", space), tag.size()));
        if (empty) return made;
        while (true) {
            skip();
            if (starts("</")) {
                at_ += 2;
                std::string_view end = until(">");
                if (end.substr(0, made->name.size()) != made->name || end.find_first_not_of(" \t\r\n", made->name.size()) != end.npos) fail();
                return made;
            }
            if (starts("<")) {
                made->children.push_back(element(depth + 1));
                continue;
            }
            auto end = text_.find('<', at_);
            if (end == text_.npos) fail();
            made->text = text_.substr(at_, end - at_);
            made->text.erase(made->text.find_last_not_of(" \t\r\n") + 1);
            at_ = end;
        }
    }
};

inline std::unique_ptr<Element> read(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    if (!file) throw std::runtime_error("cannot read " + path);
    std::string text{std::istreambuf_iterator<char>(file), {}};
    auto root = Reader(text).whole();
    if (root->name != "Parameters") throw ParseError("the outermost tag must be Parameters");
    return root;
}

inline void render(std::string& out, const Element& element, int depth) {
    std::string indent(depth, '\t');
    out += indent + "<" + element.name + (element.attributes.empty() ? "" : " " + element.attributes) + ">";
    if (element.children.empty()) {
        out += element.text;
    } else {
        out += "\n";
        for (auto& child : element.children) render(out, *child, depth + 1);
        out += indent;
    }
    out += "</" + element.name + ">\n";
}

inline void write(const std::string& path, const Element& root) {
    std::string text = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n";
    render(text, root, 0);
    std::ofstream file(path, std::ios::binary | std::ios::trunc);
    file << text;
    file.close();
    if (!file) throw std::runtime_error("cannot write " + path);
}

inline Element* axis_block(Element& root, std::size_t axis, bool make = false) {
    std::string number = std::to_string(axis);
    for (auto& one : root.children)
        if (one->name == "AxisParameters" && one->attribute("Axis") == number) return one.get();
    if (!make) return nullptr;
    root.children.push_back(std::make_unique<Element>());
    root.children.back()->name = "AxisParameters";
    root.children.back()->attributes = "Axis=\"" + number + "\"";
    return root.children.back().get();
}

// As the vendor writes it, or with as many digits as needed.
inline std::string number_text(double number, bool whole) {
    if (whole) return std::to_string(static_cast<long long>(number));
    char text[400];
    std::snprintf(text, sizeof text, "%.6f", number);
    if (std::strtod(text, nullptr) == number || !std::isfinite(number)) return text;
    std::string exact;
    wire::write_real(exact, number);
    return exact;
}

// Number of an entry; 0 for a missing one, as in the vendor's engine.
inline wire::Value number_of(Element* block, const tables::Entry& entry) {
    Element* found = block ? block->at(entry.path) : nullptr;
    if (!found || !found->children.empty()) return wire::of(0);
    try {
        wire::Value value = wire::Parser(found->text).whole();
        if (value.as<std::int64_t>() || value.as<double>()) return value;
    } catch (const wire::FrameError&) {
    }
    throw ParseError(std::string(entry.path) + " must be a number");
}

template <std::size_t N>
wire::List numbers_of(Element* block, const tables::Entry (&entries)[N]) {
    wire::List numbers;
    for (auto& entry : entries) numbers.push_back(number_of(block, entry));
    return numbers;
}

template <std::size_t N>
void set_numbers(Element& block, const tables::Entry (&entries)[N], const std::vector<double>& numbers) {
    for (std::size_t index = 0; index < N; ++index)
        block.at(entries[index].path, true)->text = number_text(numbers[index], entries[index].whole);
}

}  // namespace parameter_file
