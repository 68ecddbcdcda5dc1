// SPDX-License-Identifier: BSL-1.0
// Two network devices with a bad link between them: frames that one sends reach the other late, or not at all.
//
// It creates both devices in its own network namespace; they can be moved to others. Unlike a proxy it can lose packets
// of TCP, and unlike a token bucket it delays every frame by its transmission time.
#include "impaired_line.hpp"
#include "perf/support/descriptor.hpp"

#include <boost/asio/buffer.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/posix/stream_descriptor.hpp>
#include <boost/asio/signal_set.hpp>
#include <boost/asio/steady_timer.hpp>

#include <CLI/CLI.hpp>

#include <array>
#include <csignal>
#include <cstdio>
#include <exception>
#include <iostream>
#include <stdexcept>
#include <string>

#include <fcntl.h>
#include <linux/if_tun.h>
#include <net/if.h>
#include <sys/ioctl.h>

namespace asio = boost::asio;

namespace {

using cles::perf::impaired_line;

constexpr std::size_t largest_frame = 65536;

/// Creates a network device whose frames this process carries: what the system sends through it can be read, and what
/// is written arrives there. The device is removed when the descriptor is closed, in any network namespace. \throws
/// std::system_error if it cannot be created, or the name is in use
asio::posix::stream_descriptor open_device(asio::io_context& io, const std::string& name) {
    ifreq request{};
    if (name.empty() || name.size() >= sizeof request.ifr_name) {
        throw std::runtime_error("'" + name + "' is not a name of a network device");
    }
    cles::perf::descriptor device{
        cles::perf::checked(::open("/dev/net/tun", O_RDWR | O_NONBLOCK | O_CLOEXEC), "/dev/net/tun")};
    request.ifr_flags = static_cast<short>(IFF_TAP | IFF_NO_PI | IFF_TUN_EXCL);
    name.copy(request.ifr_name, name.size());
    cles::perf::checked(::ioctl(device.get(), TUNSETIFF, &request), name.c_str());
    return asio::posix::stream_descriptor{io, device.release()};
}

/// Carries frames from one device to the other.
class direction {
  public:
    direction(asio::io_context& io, asio::posix::stream_descriptor& from, asio::posix::stream_descriptor& to,
              const cles::perf::impairment& how, std::uint64_t seed)
        : from_(from), to_(to), line_(how, seed), timer_(io) {}

    void start() { read(); }
    [[nodiscard]] const impaired_line& line() const noexcept { return line_; }

  private:
    void read() {
        from_.async_read_some(asio::buffer(buffer_), [this](boost::system::error_code code, std::size_t size) {
            if (code == asio::error::operation_aborted) {
                return;
            }
            if (code) {
                throw boost::system::system_error(code, "reading from a device");
            }
            const auto begin = buffer_.begin();
            line_.send(impaired_line::clock::now(), {begin, begin + static_cast<std::ptrdiff_t>(size)});
            deliver();
            read();
        });
    }

    void deliver() {
        while (const auto arrived = line_.receive(impaired_line::clock::now())) {
            boost::system::error_code ignored; // the other device is down or full: lost, as on any link
            to_.write_some(asio::buffer(*arrived), ignored);
        }
        const auto next = line_.next_arrival();
        if (!next || (waiting_ && timer_.expiry() == *next)) {
            return;
        }
        waiting_ = true;
        timer_.expires_at(*next);
        timer_.async_wait([this](boost::system::error_code cancelled) {
            if (!cancelled) {
                waiting_ = false;
                deliver();
            }
        });
    }

    asio::posix::stream_descriptor& from_;
    asio::posix::stream_descriptor& to_;
    impaired_line line_;
    asio::steady_timer timer_;
    bool waiting_ = false;
    std::array<std::byte, largest_frame> buffer_{};
};

struct settings {
    std::string near = "relay0";
    std::string far = "relay1";
    double delay_ms = 0;
    double jitter_ms = 0;
    double loss_percent = 0;
    double rate_kbit = 0;
    std::size_t queue = cles::perf::impairment{}.queue;
    std::uint64_t seed = 1;
};

cles::perf::impairment to_impairment(const settings& given) {
    const auto from_ms = [](double ms) {
        return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::duration<double, std::milli>(ms));
    };
    return {.delay = from_ms(given.delay_ms),
            .jitter = from_ms(given.jitter_ms),
            .loss = given.loss_percent / 100,
            .bits_per_s = static_cast<std::uint64_t>(given.rate_kbit * 1000),
            .queue = given.queue};
}

void print_totals(const char* which, const impaired_line& line) {
    std::printf("%s: %llu frames carried, %llu lost, %llu dropped because the queue was full\n", which,
                static_cast<unsigned long long>(line.carried()), static_cast<unsigned long long>(line.lost()),
                static_cast<unsigned long long>(line.overflown()));
}

void relay(const settings& given) {
    asio::io_context io{1};
    auto near = open_device(io, given.near);
    auto far = open_device(io, given.far);
    const auto how = to_impairment(given);
    direction there{io, near, far, how, given.seed};
    direction back{io, far, near, how, given.seed + 1};
    there.start();
    back.start();
    asio::signal_set signals{io, SIGINT, SIGTERM};
    signals.async_wait([&](boost::system::error_code, int) { io.stop(); });
    std::cout << "relaying between " << given.near << " and " << given.far << std::endl;
    io.run();
    print_totals("there", there.line());
    print_totals("back", back.line());
}

} // namespace

int main(int argc, char** argv) {
    CLI::App program{"Two network devices with a bad link between them. It requires the right to create devices."};
    settings given;
    program.add_option("--near", given.near, "Name of the one device")->capture_default_str();
    program.add_option("--far", given.far, "Name of the other")->capture_default_str();
    program.add_option("--delay", given.delay_ms, "Milliseconds that each frame takes")
        ->check(CLI::Range(0.0, 10'000.0));
    program.add_option("--jitter", given.jitter_ms, "Additional milliseconds, on average; frames stay in order")
        ->check(CLI::Range(0.0, 1'000.0));
    program.add_option("--loss", given.loss_percent, "Per cent of the frames that are lost")
        ->check(CLI::Range(0.0, 100.0));
    program.add_option("--rate", given.rate_kbit, "Kilobits a second in each direction; 0: no limit")
        ->check(CLI::Range(0.0, 1e7));
    program.add_option("--queue", given.queue, "Most frames in flight, in each direction")
        ->check(CLI::Range(std::size_t{1}, std::size_t{100'000}))
        ->capture_default_str();
    program.add_option("--seed", given.seed, "Of all random numbers")->capture_default_str();
    CLI11_PARSE(program, argc, argv);
    try {
        relay(given);
        return 0;
    } catch (const std::exception& failure) {
        std::cerr << "cles_link_relay: " << failure.what() << '\n';
        return 1;
    }
}
