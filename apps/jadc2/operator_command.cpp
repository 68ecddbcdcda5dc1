// SPDX-License-Identifier: BSL-1.0
#include "operator_command.hpp"

#include <charconv>
#include <system_error>

namespace jadc2 {

operator_command parse_command(std::string_view line) {
    using word = operator_command::word;
    if (line == "confirm") {
        return {.what = word::confirm};
    }
    if (line == "hold") {
        return {.what = word::hold};
    }
    if (line == "abort") {
        return {.what = word::abort};
    }
    if (line == "quit") {
        return {.what = word::quit};
    }
    constexpr std::string_view begin = "strike ";
    constexpr std::string_view end = " again";
    if (!line.starts_with(begin)) {
        return {};
    }
    line.remove_prefix(begin.size());
    operator_command out{.what = word::strike};
    if (line.ends_with(end)) {
        out.again = true;
        line.remove_suffix(end.size());
    }
    const auto* last = line.data() + line.size();
    const auto [end_of_number, code] = std::from_chars(line.data(), last, out.target);
    return code == std::errc{} && end_of_number == last ? out : operator_command{};
}

} // namespace jadc2
