// SPDX-License-Identifier: BSL-1.0
#include "options/noun_pattern.hpp"

#include "options/arguments.hpp"
#include "output/errors.hpp"

#include <algorithm>
#include <charconv>
#include <cstddef>
#include <system_error>

namespace tool {
namespace {

// Also of texts from elsewhere, which may not be valid: those stay as they are.
std::string percent_decoded(std::string_view text) {
    std::string out;
    for (std::size_t i = 0; i < text.size(); ++i) {
        unsigned byte = 0;
        const auto* const digits = text.data() + i + 1;
        if (text[i] == '%' && i + 2 < text.size() && std::from_chars(digits, digits + 2, byte, 16).ptr == digits + 2) {
            out.push_back(static_cast<char>(byte));
            i += 2;
        } else {
            out.push_back(text[i]);
        }
    }
    return out;
}

std::vector<std::string_view> split_at(std::string_view text, char separator) {
    std::vector<std::string_view> out;
    for (;;) {
        const auto end = text.find(separator);
        out.push_back(text.substr(0, end));
        if (end == std::string_view::npos) {
            return out;
        }
        text.remove_prefix(end + 1);
    }
}

std::vector<std::string> texts_between_stars(std::string_view part) {
    std::vector<std::string> out;
    for (const auto each : split_at(part, '*')) {
        out.push_back(percent_decoded(each));
    }
    return out;
}

// Whether the text consists of these, in this order, with anything in between.
bool consists_of(std::string_view text, const std::vector<std::string>& pieces) {
    const auto& first = pieces.front();
    const auto& last = pieces.back();
    if (pieces.size() == 1) {
        return text == first;
    }
    if (text.size() < first.size() + last.size() || !text.starts_with(first) || !text.ends_with(last)) {
        return false;
    }
    text = text.substr(first.size(), text.size() - first.size() - last.size());
    for (std::size_t i = 1; i + 1 < pieces.size(); ++i) {
        const auto at = text.find(pieces[i]);
        if (at == std::string_view::npos) {
            return false;
        }
        text.remove_prefix(at + pieces[i].size());
    }
    return true;
}

} // namespace

noun_pattern::noun_pattern(std::string_view text) : is_noun_(text.find('*') == std::string_view::npos) {
    if (is_noun_) {
        check_noun(text);
    } else {
        check_noun_pattern(text);
    }
    target_ = target_of(text);
    node_ = texts_between_stars(target_);
    auto path = text.substr(target_.size() + 1);
    if (path == "**") {
        is_open_ = true;
        path = {};
    } else if (path.ends_with("/**")) {
        is_open_ = true;
        path.remove_suffix(3);
    }
    if (target_.find("**") != std::string::npos || path.find("**") != std::string_view::npos) {
        throw usage_error("'" + std::string{text} +
                          "': '**' stands for all that follows, so it is the last part, as in car1:** or "
                          "car1:tyre/**");
    }
    if (!path.empty()) {
        for (const auto each : split_at(path, '/')) {
            parts_.push_back(texts_between_stars(each));
        }
    }
}

bool noun_pattern::is_of_many_nodes() const noexcept {
    return !is_noun_ && (target_ == "all" || target_.find('*') != std::string::npos);
}

bool noun_pattern::matches_node(std::string_view name) const {
    return (target_ == "all" && !is_noun_) || consists_of(name, node_);
}

bool noun_pattern::matches_path(std::string_view path) const {
    const auto found = split_at(path, '/');
    if (found.size() < parts_.size() || (!is_open_ && found.size() > parts_.size())) {
        return false;
    }
    return std::equal(parts_.begin(), parts_.end(), found.begin(), [](const part& wanted, std::string_view each) {
        return consists_of(percent_decoded(each), wanted);
    });
}

} // namespace tool
