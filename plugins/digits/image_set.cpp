// SPDX-License-Identifier: BSL-1.0
#include "image_set.hpp"

#include <array>
#include <charconv>
#include <cstdio>
#include <limits>
#include <memory>
#include <stdexcept>
#include <utility>

namespace digits {
namespace {

// The number before the next comma, or the end; `left` is what follows.
std::uint32_t take_number(std::string_view& left, std::uint32_t most, const char* what) {
    const auto comma = left.find(',');
    const auto text = left.substr(0, comma);
    std::uint32_t number = 0;
    const auto [end, failed] = std::from_chars(text.data(), text.data() + text.size(), number);
    if (failed != std::errc{} || end != text.data() + text.size() || number > most) {
        throw std::invalid_argument(std::string{what} + ": '" + std::string{text.substr(0, 32)} +
                                    "' is not a whole number from 0 to " + std::to_string(most));
    }
    left = comma == std::string_view::npos ? std::string_view{} : left.substr(comma + 1);
    return number;
}

void check_range(const char* name, std::uint32_t value, std::uint32_t least, std::uint32_t most) {
    if (value < least || value > most) {
        throw std::invalid_argument(std::string{name} + ": " + std::to_string(least) + " to " + std::to_string(most));
    }
}

// The text up to the next end of a line; `left` is what follows.
std::string_view take_line(std::string_view& left) {
    const auto end = left.find('\n');
    auto line = left.substr(0, end);
    left = end == std::string_view::npos ? std::string_view{} : left.substr(end + 1);
    if (line.ends_with('\r')) {
        line.remove_suffix(1);
    }
    return line;
}

file_header read_header(std::string_view line) {
    file_header out;
    while (!line.empty()) {
        const auto comma = line.find(',');
        const auto item = line.substr(0, comma);
        const auto equals = item.find('=');
        const auto key = item.substr(0, equals);
        auto value = equals == std::string_view::npos ? std::string_view{} : item.substr(equals + 1);
        constexpr auto most = std::numeric_limits<std::uint32_t>::max();
        if (key == "pixels") {
            out.pixels = take_number(value, most, "pixels");
        } else if (key == "brightest") {
            out.brightest = take_number(value, most, "brightest");
        } else if (key == "classes") {
            out.classes = take_number(value, most, "classes");
        } else if (key == "best_accuracy") {
            double best = -1;
            const auto [end, failed] = std::from_chars(value.data(), value.data() + value.size(), best);
            if (failed != std::errc{} || end != value.data() + value.size() || !(best >= 0 && best <= 1)) {
                throw std::invalid_argument("best_accuracy: a number from 0 to 1");
            }
            out.best_accuracy = best;
        } else {
            throw std::invalid_argument("the first line is like pixels=64,brightest=16,classes=10, not '" +
                                        std::string{item.substr(0, 32)} + "'");
        }
        line = comma == std::string_view::npos ? std::string_view{} : line.substr(comma + 1);
    }
    return out;
}

// Programs that other threads start meanwhile do not inherit the file.
std::string text_of(const std::string& name) {
    const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file{std::fopen(name.c_str(), "re"), &std::fclose};
    if (!file) {
        throw std::invalid_argument(name + ": it cannot be read");
    }
    std::string text;
    std::array<char, 65'536> some{};
    while (const auto count = std::fread(some.data(), 1, some.size(), file.get())) {
        text.append(some.data(), count);
    }
    return text;
}

} // namespace

image_set::image_set(const file_header& like) : header_(like) {
    check_range("pixels", like.pixels, 1, 4096);
    check_range("brightest", like.brightest, 1, 65'535);
    check_range("classes", like.classes, 2, 256);
}

void image_set::add_line(std::string_view line) {
    if (pixels_.size() + header_.pixels > most_values) {
        throw std::invalid_argument("there are too many images");
    }
    const auto scale = 1 / static_cast<float>(header_.brightest);
    std::vector<float> image;
    image.reserve(header_.pixels);
    for (std::uint32_t i = 0; i < header_.pixels; ++i) {
        image.push_back(static_cast<float>(take_number(line, header_.brightest, "pixel")) * scale);
    }
    const auto of_class = take_number(line, header_.classes - 1, "class");
    if (!line.empty()) {
        throw std::invalid_argument("there are more than " + std::to_string(header_.pixels) + " pixels and a class");
    }
    pixels_.insert(pixels_.end(), image.begin(), image.end());
    classes_.push_back(static_cast<std::uint8_t>(of_class));
}

void image_set::check_kind(const image_set& others) const {
    const auto& theirs = others.header_;
    if (theirs.pixels != header_.pixels || theirs.brightest != header_.brightest || theirs.classes != header_.classes) {
        throw std::invalid_argument("its images are of another kind than those before");
    }
}

void image_set::add(const image_set& others) {
    check_kind(others);
    if (pixels_.size() + others.pixels_.size() > most_values) {
        throw std::invalid_argument("there are too many images");
    }
    pixels_.insert(pixels_.end(), others.pixels_.begin(), others.pixels_.end());
    classes_.insert(classes_.end(), others.classes_.begin(), others.classes_.end());
}

image_set image_set::parse(std::string_view text, const std::string& name) {
    std::size_t number = 1;
    try {
        image_set out{read_header(take_line(text))};
        while (!text.empty()) {
            ++number;
            if (const auto line = take_line(text); !line.empty()) {
                out.add_line(line);
            }
        }
        if (out.size() == 0) {
            throw std::invalid_argument("there is no image");
        }
        return out;
    } catch (const std::invalid_argument& e) {
        throw std::invalid_argument(name + ":" + std::to_string(number) + ": " + e.what());
    }
}

image_set image_set::read(const std::vector<std::string>& files) {
    std::optional<image_set> all;
    for (const auto& name : files) {
        auto images = parse(text_of(name), name);
        if (!all) {
            all = std::move(images);
            continue;
        }
        try {
            all->add(images);
        } catch (const std::invalid_argument& e) {
            throw std::invalid_argument(name + ": " + e.what());
        }
    }
    if (!all) {
        throw std::invalid_argument("no file is named");
    }
    return *std::move(all);
}

} // namespace digits
