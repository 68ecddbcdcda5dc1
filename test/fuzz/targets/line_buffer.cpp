// SPDX-License-Identifier: BSL-1.0
// Lines from a stream: they do not depend on how it is split into reads.
//
// The input's first four bytes select the limit, how often the rest is repeated, and two numbers that determine the
// splits.
#include "fuzz/fuzz.hpp"
#include "protocol/line.hpp"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

namespace cles::fuzz {
namespace {

struct outcome {
    std::vector<std::string> lines;
    std::string head;
    bool overlong = false;
    std::size_t unfinished = 0;
    bool operator==(const outcome&) const = default;
};

/// A second, simpler implementation.
outcome expected(std::string_view stream, std::size_t limit) {
    outcome result;
    while (!stream.empty()) {
        const auto end = stream.find('\n');
        const auto line = stream.substr(0, end);
        if (line.size() - (line.ends_with('\r') ? 1 : 0) > limit) { // a CR before the LF does not count
            result.overlong = true;
            result.head = line.substr(0, limit);
            return result;
        }
        if (end == std::string_view::npos) {
            result.unfinished = line.size();
            return result;
        }
        result.lines.emplace_back(line);
        stream.remove_prefix(end + 1);
    }
    return result;
}

/// Delivers the stream in pieces of at most this many bytes.
template <class Cut>
outcome buffered(std::string_view stream, std::size_t limit, Cut next_cut) {
    constexpr std::size_t read_ahead = 65536;
    protocol::line_buffer buffer{limit};
    outcome result;
    while (!stream.empty()) {
        const auto space = buffer.prepare();
        require(!space.empty(), "there is always room for a read");
        require(space.size() <= limit + 2 * read_ahead, "a buffer stays within its bounds");
        const auto size = std::min({space.size(), stream.size(), next_cut()});
        std::memcpy(space.data(), stream.data(), size);
        stream.remove_prefix(size);
        buffer.commit(size);
        std::string_view line;
        for (;;) {
            const auto status = buffer.next(line);
            if (status == protocol::line_buffer::status::need_more) {
                break;
            }
            if (status == protocol::line_buffer::status::overlong) {
                result.overlong = true;
                result.head = line;
                return result;
            }
            result.lines.emplace_back(line);
        }
    }
    result.unfinished = buffer.unfinished().size();
    return result;
}

} // namespace

void run(std::string_view input) {
    constexpr std::size_t head = 4;
    if (input.size() < head) {
        return;
    }
    const auto byte = [&](std::size_t i) { return static_cast<std::size_t>(static_cast<unsigned char>(input[i])); };
    const auto limit = 1 + byte(0) * byte(0);
    std::string stream;
    for (std::size_t i = 0; i <= byte(1) % 32; ++i) {
        stream.append(input.substr(head));
    }
    const auto wanted = expected(stream, limit);
    require(buffered(stream, limit, [] { return std::size_t{1} << 20U; }) == wanted, "one read gives these lines");

    std::uint32_t state = static_cast<std::uint32_t>(byte(2) + 256 * byte(3) + 1);
    const auto most = 1 + byte(3) * 16;
    const auto drawn = [&] {
        state = state * 1664525U + 1013904223U;
        return 1 + (state >> 8U) % most;
    };
    require(buffered(stream, limit, drawn) == wanted, "many reads give the same lines");
    if (stream.size() <= 4096) {
        require(buffered(stream, limit, [] { return std::size_t{1}; }) == wanted, "single bytes give the same lines");
    }
}

} // namespace cles::fuzz
