// SPDX-License-Identifier: BSL-1.0
#include "frame_load.hpp"

#include <cles/service.hpp>

#include "client/member_key.hpp"
#include "events.hpp"
#include "fmv/frame_codec.hpp"
#include "fmv/messages.hpp"
#include "scene.hpp"

#include <boost/asio/co_spawn.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/signal_set.hpp>

#include <chrono>
#include <csignal>
#include <cstdio>
#include <vector>

namespace jadc2 {
namespace {

using steady = std::chrono::steady_clock;

constexpr std::uint64_t frame_deadline_ms = 10'000;
constexpr double fps = 25;           ///< of the times in the frames
constexpr std::size_t pictures = 50; ///< sent repeatedly, because only the load matters

struct work {
    const load_options& args;
    const scene& ground;
    const std::vector<std::string>& pictures_sent;
    cles::service& from;
    steady::time_point until{};
    std::uint64_t ended = 0, answered = 0, done = 0;
    double run_ms = 0;
    std::exception_ptr failure{};
};

boost::asio::awaitable<void> send_stream(work& all, std::string stream) {
    const auto options = cles::call_options{}.deadline(std::chrono::milliseconds{frame_deadline_ms}).at(all.args.at);
    for (std::uint64_t number = 0; steady::now() < all.until; ++number) {
        const fmv::frame_message what{.stream = stream,
                                      .frame = number,
                                      .utc = static_cast<double>(number) / fps,
                                      .width = scene::size.width,
                                      .height = scene::size.height,
                                      .deadline_ms = frame_deadline_ms,
                                      .camera = all.ground.reported(static_cast<double>(number % pictures) / fps),
                                      .format = all.args.format,
                                      .picture = all.pictures_sent[number % pictures]};
        const auto seen = co_await all.from.async_delegate<fmv::found>("self:FMV_Frame", what, options);
        ++all.done;
        all.run_ms += seen.run_ms;
        if (number == 0 && ++all.answered == all.args.streams) {
            std::puts("loading");
            std::fflush(stdout);
        }
    }
}

struct load_summary {
    std::uint64_t frames = 0;
    double frames_a_second = 0, mean_run_ms = 0;
};
BOOST_DESCRIBE_STRUCT(load_summary, (), (frames, frames_a_second, mean_run_ms))

} // namespace

int run_load(const load_options& args) {
    const scene ground{args.seed};
    std::vector<std::string> sent;
    for (std::uint64_t number = 0; number < pictures; ++number) {
        const auto frame = ground.frame(number, static_cast<double>(number) / fps);
        sent.push_back(fmv::encode(frame, scene::size, args.format));
    }
    boost::asio::io_context io{1};
    cles::service node{io, tool::options_of_member("load", args.keys)};
    const auto begun = steady::now();
    work all{.args = args,
             .ground = ground,
             .pictures_sent = sent,
             .from = node,
             .until = args.duration_s > 0 ? begun + std::chrono::duration_cast<steady::duration>(
                                                        std::chrono::duration<double>{args.duration_s})
                                          : steady::time_point::max()};
    boost::asio::signal_set signals{io, SIGINT, SIGTERM};
    signals.async_wait([&all](boost::system::error_code code, int) {
        if (!code) {
            all.until = {}; // the frames in flight are still answered
        }
    });
    const auto run = "load-" + run_id() + "-";
    for (std::uint64_t i = 0; i < args.streams; ++i) {
        boost::asio::co_spawn(io, send_stream(all, run + std::to_string(i)), [&](const std::exception_ptr& thrown) {
            if (thrown && !all.failure) { // the others end because the node is stopped
                all.failure = thrown;
            }
            if (++all.ended == args.streams || thrown) {
                signals.cancel();
                node.stop();
            }
        });
    }
    io.run();
    if (all.failure) {
        std::rethrow_exception(all.failure);
    }
    const std::chrono::duration<double> took = steady::now() - begun;
    std::puts(cles::to_json(load_summary{all.done, static_cast<double>(all.done) / took.count(),
                                         all.done == 0 ? 0 : all.run_ms / static_cast<double>(all.done)})
                  .c_str());
    return 0;
}

} // namespace jadc2
