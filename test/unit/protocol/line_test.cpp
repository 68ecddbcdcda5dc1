// SPDX-License-Identifier: BSL-1.0
#include "protocol/line.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <random>
#include <string>
#include <string_view>
#include <vector>

namespace line {
namespace {

using cles::protocol::line_buffer;
using status = line_buffer::status;

void put(line_buffer& buffer, std::string_view bytes) {
    while (!bytes.empty()) {
        const auto space = buffer.prepare();
        const auto count = std::min(space.size(), bytes.size());
        std::memcpy(space.data(), bytes.data(), count);
        buffer.commit(count);
        bytes.remove_prefix(count);
    }
}

std::vector<std::string> take_lines(line_buffer& buffer) {
    std::vector<std::string> lines;
    std::string_view line;
    while (buffer.next(line) == status::line) {
        lines.emplace_back(line);
    }
    return lines;
}

// Adds as much as fits at once and takes the lines in between, as a link does.
std::vector<std::string> feed(line_buffer& buffer, std::string_view bytes, std::size_t at_once) {
    std::vector<std::string> lines;
    while (!bytes.empty()) {
        const auto space = buffer.prepare();
        const auto count = std::min({space.size(), bytes.size(), at_once});
        std::memcpy(space.data(), bytes.data(), count);
        buffer.commit(count);
        bytes.remove_prefix(count);
        const auto more = take_lines(buffer);
        lines.insert(lines.end(), more.begin(), more.end());
    }
    return lines;
}

constexpr std::size_t mebibyte = 1U << 20U;

} // namespace
} // namespace line

BOOST_AUTO_TEST_SUITE(line)

BOOST_AUTO_TEST_CASE(a_line_is_ended_by_lf) {
    line_buffer buffer{100};
    std::string_view text;
    put(buffer, "PULL a:b");
    BOOST_CHECK(buffer.next(text) == status::need_more);
    BOOST_TEST(buffer.unfinished().size() == 8U);
    put(buffer, "\nPULL");
    BOOST_CHECK(buffer.next(text) == status::line);
    BOOST_TEST(text == "PULL a:b");
    BOOST_CHECK(buffer.next(text) == status::need_more);
    BOOST_TEST(buffer.unfinished().size() == 4U);
}

BOOST_AUTO_TEST_CASE(one_read_may_hold_many_lines) {
    line_buffer buffer{100};
    put(buffer, "one\n\ntwo\r\nthree");
    const std::vector<std::string> expected{"one", "", "two\r"};
    const auto lines = take_lines(buffer);
    BOOST_TEST(lines == expected, boost::test_tools::per_element());
}

BOOST_AUTO_TEST_CASE(bytes_may_arrive_one_at_a_time) {
    line_buffer buffer{100};
    const std::vector<std::string> expected{"PULL car1:speed id=1", "", "PUSH car1:log {\"a\":1}"};
    const auto lines = feed(buffer, "PULL car1:speed id=1\n\nPUSH car1:log {\"a\":1}\n", 1);
    BOOST_TEST(lines == expected, boost::test_tools::per_element());
}

BOOST_AUTO_TEST_CASE(lines_are_the_same_however_the_bytes_are_split) {
    std::mt19937 random{7};
    std::vector<std::string> sent;
    std::string bytes;
    for (int i = 0; i < 400; ++i) {
        const auto length = i % 40 == 0 ? random() % 150'000 : random() % 300;
        sent.emplace_back(length, static_cast<char>('a' + i % 26));
        bytes += sent.back() + "\n";
    }
    for (const std::size_t at_once : {std::size_t{1}, std::size_t{7}, std::size_t{4096}, std::size_t{1} << 30U}) {
        line_buffer buffer{200'000};
        const auto lines = feed(buffer, at_once == 1 ? std::string_view{bytes}.substr(0, 400'000) : bytes, at_once);
        BOOST_TEST_REQUIRE((at_once == 1 || lines.size() == sent.size()));
        BOOST_TEST_REQUIRE(lines.size() > 10U);
        BOOST_TEST(std::equal(lines.begin(), lines.end(), sent.begin()), "at once: " << at_once);
    }
}

BOOST_AUTO_TEST_CASE(a_line_at_the_limit_passes_and_one_byte_more_is_overlong) {
    for (const std::size_t limit : {std::size_t{10}, std::size_t{5000}, mebibyte}) {
        line_buffer fits{limit};
        std::string_view text;
        put(fits, std::string(limit, 'x'));
        put(fits, "\n");
        BOOST_CHECK(fits.next(text) == status::line);
        BOOST_TEST(text.size() == limit);

        line_buffer ended{limit};
        put(ended, std::string(limit + 1, 'x'));
        put(ended, "\n");
        BOOST_CHECK(ended.next(text) == status::overlong);
        BOOST_TEST(text.size() == limit);
    }
}

BOOST_AUTO_TEST_CASE(an_endless_line_is_overlong_before_its_end) {
    line_buffer buffer{mebibyte};
    std::string_view text;
    put(buffer, "PULL car1:speed id=7 " + std::string(mebibyte, 'x'));
    BOOST_CHECK(buffer.next(text) == status::overlong);
    BOOST_TEST(text.starts_with("PULL car1:speed id=7 xxx"));
}

BOOST_AUTO_TEST_CASE(lines_before_an_overlong_one_are_returned) {
    line_buffer buffer{10};
    std::string_view text;
    put(buffer, "first\n" + std::string(11, 'x') + "\nlast\n");
    BOOST_CHECK(buffer.next(text) == status::line);
    BOOST_TEST(text == "first");
    BOOST_CHECK(buffer.next(text) == status::overlong);
    BOOST_CHECK(buffer.next(text) == status::overlong); // no more lines follow
}

BOOST_AUTO_TEST_CASE(a_long_line_that_arrives_slowly_is_copied_only_a_few_times) {
    line_buffer buffer{mebibyte};
    std::string_view text;
    std::size_t moves = 0;
    const char* expected = nullptr;
    for (std::size_t sent = 0; sent < mebibyte; sent += 256) {
        const auto space = buffer.prepare();
        moves += space.data() == expected ? 0 : 1;
        const auto count = std::min<std::size_t>(space.size(), 256);
        std::fill_n(space.data(), count, 'x');
        expected = space.data() + count;
        buffer.commit(count);
        BOOST_REQUIRE(buffer.next(text) == status::need_more);
    }
    BOOST_TEST(moves < 20U);
}

BOOST_AUTO_TEST_CASE(the_memory_of_a_long_line_is_released) {
    line_buffer buffer{mebibyte};
    put(buffer, std::string(mebibyte, 'x'));
    put(buffer, "\n");
    BOOST_TEST(buffer.prepare().size() < mebibyte / 2);
    BOOST_TEST(take_lines(buffer).size() == 1U);
    BOOST_TEST(buffer.prepare().size() <= 65'536U);
    put(buffer, "short\n");
    BOOST_TEST(take_lines(buffer) == std::vector<std::string>{"short"}, boost::test_tools::per_element());
}

BOOST_AUTO_TEST_CASE(an_idle_link_uses_little_memory) {
    line_buffer buffer{mebibyte};
    BOOST_TEST(buffer.prepare().size() <= 4096U);
    put(buffer, "PULL car1:speed\n");
    take_lines(buffer);
    BOOST_TEST(buffer.prepare().size() <= 4096U);
}

BOOST_AUTO_TEST_CASE(there_is_always_space_for_the_next_bytes) {
    line_buffer buffer{5000};
    std::string_view text;
    std::size_t lines = 0;
    for (int i = 0; i < 2000; ++i) {
        const auto space = buffer.prepare();
        BOOST_REQUIRE(!space.empty());
        const auto count = std::min<std::size_t>(space.size(), 1777);
        std::fill_n(space.data(), count, 'x');
        space[count - 1] = i % 2 == 0 ? 'x' : '\n';
        buffer.commit(count);
        while (buffer.next(text) == status::line) {
            ++lines;
        }
    }
    BOOST_TEST(lines == 1000U);
}

BOOST_AUTO_TEST_CASE(a_cr_before_the_lf_and_sp_at_either_end_are_dropped) {
    using cles::protocol::trim;
    BOOST_TEST(trim("PULL a:b\r") == "PULL a:b");
    BOOST_TEST(trim("  PULL a:b  ") == "PULL a:b");
    BOOST_TEST(trim("  PULL a:b  \r") == "PULL a:b");
    BOOST_TEST(trim("\r").empty());
    BOOST_TEST(trim("   ").empty());
    BOOST_TEST(trim("").empty());
    BOOST_TEST(trim("a\rb") == "a\rb");
    BOOST_TEST(trim("a\r\r") == "a\r"); // one CR belongs to the end of the line
}

BOOST_AUTO_TEST_CASE(tab_is_not_sp) { BOOST_TEST(cles::protocol::trim("\tPULL a:b\t") == "\tPULL a:b\t"); }

BOOST_AUTO_TEST_CASE(http_lines_are_recognised) {
    using cles::protocol::is_http;
    for (const std::string_view http : {"POST / HTTP/1.1", "GET /cles HTTP/1.0", "Host: localhost:25370",
                                        "Host:", "host: x", "HOST:x", "PUSH self:cles/cancel/1 HTTP/1.1"}) {
        BOOST_TEST(is_http(http), http);
    }
    for (const std::string_view ours : {"PULL car1:Host", "PULL Host:speed", "Hos", "PULL a:b HTTP/1.2", "HTTP/1.1",
                                        "PULL a:b/HTTP/1.1", "", "PUSH a:b {\"x\":\" HTTP/1.1\"}"}) {
        BOOST_TEST(!is_http(ours), ours);
    }
}

BOOST_AUTO_TEST_CASE(a_cr_before_the_lf_does_not_count) {
    const auto feed = [](std::string_view text) {
        cles::protocol::line_buffer buffer{10};
        const auto space = buffer.prepare();
        std::copy(text.begin(), text.end(), space.begin());
        buffer.commit(text.size());
        std::string_view line;
        return buffer.next(line);
    };
    using status = cles::protocol::line_buffer::status;
    BOOST_CHECK(feed("0123456789\n") == status::line);
    BOOST_CHECK(feed("0123456789\r\n") == status::line);
    BOOST_CHECK(feed("0123456789\r") == status::need_more);
    BOOST_CHECK(feed("0123456789a\n") == status::overlong);
    BOOST_CHECK(feed("0123456789a\r\n") == status::overlong);
    BOOST_CHECK(feed("0123456789\r\r\n") == status::overlong);
}

BOOST_AUTO_TEST_CASE(an_idle_buffer_releases_its_growth) {
    line_buffer buffer{1U << 20U};
    put(buffer, std::string(1'000'000, 'x') + "\n");
    BOOST_TEST(take_lines(buffer).size() == 1U);
    BOOST_TEST(buffer.capacity() > 1'000'000U);
    buffer.shrink();
    BOOST_TEST(buffer.capacity() == 4096U);
    put(buffer, "next\nbeg");
    BOOST_TEST(take_lines(buffer).front() == "next");
    buffer.shrink();
    put(buffer, "un\n");
    BOOST_TEST(take_lines(buffer).front() == "begun");
}

BOOST_AUTO_TEST_CASE(a_partial_line_survives_shrinking) {
    line_buffer buffer{1U << 20U};
    const std::string line(100'000, 'y');
    put(buffer, std::string(500'000, 'x') + "\n" + line);
    std::string_view first;
    BOOST_TEST((buffer.next(first) == status::line));
    buffer.shrink();
    BOOST_TEST(buffer.capacity() == 200'000U);
    put(buffer, "z\n");
    BOOST_TEST((take_lines(buffer).front() == line + "z"));
}

BOOST_AUTO_TEST_CASE(an_unused_buffer_has_nothing_to_release) {
    line_buffer buffer{1U << 20U};
    buffer.shrink();
    BOOST_TEST(buffer.capacity() == 0U);
}

BOOST_AUTO_TEST_SUITE_END()
