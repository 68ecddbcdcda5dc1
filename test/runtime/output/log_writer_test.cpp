// SPDX-License-Identifier: BSL-1.0
#include "output/log_queue.hpp"
#include "output/log_writer.hpp"

#include <boost/test/unit_test.hpp>

#include <array>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include <fcntl.h>
#include <unistd.h>

namespace log_writer_cases {
namespace {

using namespace std::chrono_literals;

/// A pipe that takes one page.
struct small_pipe {
    small_pipe() {
        BOOST_REQUIRE(::pipe2(ends.data(), O_CLOEXEC) == 0);
        BOOST_REQUIRE(::fcntl(ends[1], F_SETPIPE_SZ, 4096) >= 0);
    }
    small_pipe(const small_pipe&) = delete;
    small_pipe& operator=(const small_pipe&) = delete;
    ~small_pipe() {
        close_end(0);
        close_end(1);
    }
    void close_end(std::size_t which) {
        if (ends[which] >= 0) {
            ::close(ends[which]);
            ends[which] = -1;
        }
    }
    void fill() const {
        const std::string page(4096, '.');
        BOOST_REQUIRE(::write(ends[1], page.data(), page.size()) == 4096);
    }
    /// Reads until there is that text.
    void read_until(std::string_view text) {
        std::array<char, 4096> some{};
        while (read.find(text) == std::string::npos) {
            const auto count = ::read(ends[0], some.data(), some.size());
            BOOST_REQUIRE(count > 0);
            read.append(some.data(), static_cast<std::size_t>(count));
        }
    }
    [[nodiscard]] tool::stream to() const { return static_cast<tool::stream>(ends[1]); }

    std::array<int, 2> ends{-1, -1};
    std::string read;
};

std::string dropped(std::uint64_t count) { return "dropped " + std::to_string(count) + "\n"; }

struct fixture {
    small_pipe pipe;
    std::optional<tool::log_writer> log{std::in_place, pipe.to(), dropped};
};

} // namespace
} // namespace log_writer_cases

BOOST_FIXTURE_TEST_SUITE(log_writer, log_writer_cases::fixture)

BOOST_AUTO_TEST_CASE(the_last_lines_are_written_before_it_ends) {
    for (int i = 0; i < 100; ++i) {
        log->write("line " + std::to_string(i) + "\n");
    }
    log.reset();
    pipe.read_until("line 99\n");
    BOOST_TEST(pipe.read.find("line 98\nline 99\n") != std::string::npos);
}

BOOST_AUTO_TEST_CASE(it_says_how_many_lines_nobody_has_read) {
    pipe.fill();
    const auto most = tool::log_queue::most_lines;
    for (std::size_t i = 0; i < 2 * most; ++i) { // one of them may be in the writer's hands
        log->write("x\n");
    }
    pipe.read_until("dropped ");
    log->write("after\n");
    pipe.read_until("after\n");
    std::size_t lines = 0;
    for (std::size_t at = pipe.read.find("x\n"); at != std::string::npos; at = pipe.read.find("x\n", at + 1)) {
        ++lines;
    }
    std::size_t counted = 0;
    for (auto at = pipe.read.find("dropped "); at != std::string::npos; at = pipe.read.find("dropped ", at + 1)) {
        counted += std::stoul(pipe.read.substr(at + 8));
    }
    BOOST_TEST(lines + counted == 2 * most);
    BOOST_TEST(lines >= most);
    BOOST_TEST(pipe.read.ends_with("\nafter\n"));
}

BOOST_AUTO_TEST_CASE(a_reader_that_never_reads_delays_the_end_for_a_moment_only) {
    pipe.fill();
    log->write("x\n");
    const auto begun = std::chrono::steady_clock::now();
    log.reset();
    BOOST_TEST((std::chrono::steady_clock::now() - begun < 10 * tool::log_writer::last_wait));
    pipe.close_end(0); // ends the writer's thread
    pipe.ends[1] = -1; // which may still use it: it stays open
}

BOOST_AUTO_TEST_CASE(lines_that_cannot_be_written_are_counted) {
    const int full = ::open("/dev/full", O_WRONLY | O_CLOEXEC);
    BOOST_REQUIRE(full >= 0);
    const auto most = std::make_shared<std::atomic<std::uint64_t>>(0); // the thread may outlive this test
    {
        tool::log_writer to_full{static_cast<tool::stream>(full), [most](std::uint64_t count) {
                                     *most = count;
                                     return log_writer_cases::dropped(count);
                                 }};
        for (int i = 0; i < 3; ++i) {
            to_full.write("x\n");
        }
    }
    BOOST_TEST(most->load() == 2U);
}

BOOST_AUTO_TEST_SUITE_END()
