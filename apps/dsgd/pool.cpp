// SPDX-License-Identifier: BSL-1.0
#include "pool.hpp"

#include <boost/asio/co_spawn.hpp>
#include <boost/asio/detached.hpp>
#include <boost/asio/steady_timer.hpp>

#include <cstdio>
#include <utility>

#include <unistd.h>

namespace dsgd {

using steady = std::chrono::steady_clock;

struct offers {
    std::map<std::string, sgd::recipe> results;
};
BOOST_DESCRIBE_STRUCT(offers, (), (results))

struct pool::round {
    board& all;
    std::size_t open;
    std::vector<double> progress;  ///< of each shard
    double done = 0, reported = 0; ///< of all, in percent
    char end_of_line = ::isatty(STDERR_FILENO) == 1 ? '\r' : '\n';
    steady::time_point begun = steady::now();

    void report_progress(double& shard, double part) {
        done += (part - std::exchange(shard, part)) / static_cast<double>(progress.size()) * 100;
        if (done >= reported + 10) {
            reported = done;
            std::fprintf(stderr, "cles-dsgd: %2.0f %% of %zu shards%c", done, progress.size(), end_of_line);
        }
    }
};

pool::pool(const std::vector<std::string>& seeds, std::chrono::seconds deadline, bool progress)
    : deadline_(deadline), progress_(progress),
      node_(io_,
            {.name = "dsgd-" + std::to_string(::getpid()), .gossip = cles::gossip(seeds), .routing = cles::routing()}) {
}

std::map<std::string, sgd::recipe> pool::find() {
    try {
        return cles::from_json<offers>(
                   node_.request("PULL all:sgd", cles::call_options{}.deadline(std::chrono::seconds{2})))
            .results;
    } catch (const cles::error& e) {
        const bool alone = e.code() == cles::errc::no_target && node_.peers().empty();
        throw cles::error(e.code(), alone ? "no node answers at the given address (--at): is clesd running there?"
                                          : e.message() + ": is libcles-sgd.so among the plugins of a node?");
    }
}

void pool::train(board& all) {
    round now{all, all.shards().size(), std::vector<double>(all.shards().size())};
    for (std::size_t i = 0; i < all.shards().size(); ++i) {
        boost::asio::co_spawn(io_, delegate(now, i), boost::asio::detached);
    }
    io_.restart();
    while (now.open != 0 && io_.run_one() != 0) {
    }
}

boost::asio::awaitable<void> pool::delegate(round& now, std::size_t i) {
    auto options = cles::call_options{}.deadline(deadline_);
    if (progress_) {
        options.on_progress([&now, i](double part, std::string_view) { now.report_progress(now.progress[i], part); });
    }
    const auto& shard = now.all.shards()[i];
    while (shard.fate == "open") {
        std::optional<cles::error> failure;
        const auto noun = shard.target + ":sgd/train";
        try {
            auto part = co_await node_.async_delegate<sgd::trained>(noun, shard.what, options);
            part.after_ms = std::chrono::duration<double, std::milli>(steady::now() - now.begun).count();
            now.all.done(i, part);
        } catch (const cles::error& e) {
            failure = e;
        }
        if (failure && now.all.failed(i, *failure)) {
            std::fprintf(stderr, "cles-dsgd: shard %zu: %s; retrying at %s\n", i + 1, shard.trouble.back().c_str(),
                         shard.target.c_str());
            boost::asio::steady_timer pause{io_, std::chrono::milliseconds{20}};
            co_await pause.async_wait(boost::asio::use_awaitable);
        } else if (failure) {
            node_.stop(); // cancels the others
        }
    }
    --now.open;
}

} // namespace dsgd
