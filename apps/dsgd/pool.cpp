// SPDX-License-Identifier: BSL-1.0
#include "pool.hpp"

#include <cles/printable.hpp>

#include <boost/asio/co_spawn.hpp>
#include <boost/asio/redirect_error.hpp>
#include <boost/asio/steady_timer.hpp>

#include <cstdio>
#include <exception>
#include <optional>
#include <utility>

#include <unistd.h>

namespace dsgd {

using steady = std::chrono::steady_clock;

struct refusal {
    std::string error{}, message{};
};
BOOST_DESCRIBE_STRUCT(refusal, (), (error, message))

// The reply to PULL all:sgd: of each node its data, or why it did not answer.
struct offers {
    std::map<std::string, sgd::recipe> results;
    std::map<std::string, refusal> errors;
};
BOOST_DESCRIBE_STRUCT(offers, (), (results, errors))

// For a node that is busy as well; one that has stopped takes all of it.
constexpr std::chrono::seconds find_deadline{5};

struct pool::round {
    board& all;
    const char* what;
    boost::asio::steady_timer changed; ///< cancelled when a shard has ended: slots without one wait for that
    std::size_t open;                  ///< slots that may have more to do
    std::exception_ptr crash{};
    std::vector<double> progress; ///< of the shard of each slot, in points
    double done = 0;              ///< of all, in points
    double reported = 0;          ///< in percent
    char end_of_line = ::isatty(STDERR_FILENO) == 1 ? '\r' : '\n';
    steady::time_point begun = steady::now();

    round(boost::asio::io_context& io, board& work, const char* called)
        : all(work), what(called), changed(io, steady::time_point::max()), open(work.slots()), progress(work.slots()) {}

    double ms() const { return std::chrono::duration<double, std::milli>(steady::now() - begun).count(); }

    void report_progress(std::size_t shard, double part) {
        const auto& entry = all.shards()[shard];
        const auto points = part * static_cast<double>(entry.what.count);
        done += points - std::exchange(progress[entry.slot], points);
        if (const auto percent = done / static_cast<double>(all.points()) * 100; percent >= reported + 10) {
            reported = percent;
            std::fprintf(stderr, "cles-dsgd: %s%2.0f %% of %ju points%c", what, percent, std::uintmax_t{all.points()},
                         end_of_line);
        }
    }
};

pool::pool(const std::vector<std::string>& seeds, std::chrono::seconds deadline, bool progress)
    : deadline_(deadline), progress_(progress),
      node_(io_,
            {.name = "dsgd-" + std::to_string(::getpid()), .gossip = cles::gossip(seeds), .routing = cles::routing()}) {
}

std::map<std::string, sgd::recipe> pool::find() {
    offers found;
    try {
        found = cles::from_json<offers>(node_.request("PULL all:sgd", cles::call_options{}.deadline(find_deadline)));
    } catch (const cles::error& e) {
        if (node_.peers().empty()) {
            throw cles::error(cles::errc::no_target,
                              "no node answers at the given address (--at): is clesd running there?");
        }
        throw cles::error(e.code(), e.message() + ": is libcles-sgd.so among the plugins of a node?");
    }
    std::string silent;
    for (const auto& [name, why] : found.errors) {
        const auto shown = cles::printable(name);
        std::fprintf(stderr, "cles-dsgd: %s does not take part: %s\n", shown.c_str(),
                     cles::printable(why.message).c_str());
        silent += (silent.empty() ? "" : ", ") + shown;
    }
    if (found.results.empty()) {
        throw cles::error(cles::errc::deadline, "no node that offers 'sgd' answers: " + silent);
    }
    return found.results;
}

void pool::train(board& all, const char* what) {
    round now{io_, all, what};
    for (std::size_t slot = 0; slot < all.slots(); ++slot) {
        boost::asio::co_spawn(io_, work(now, slot), [&now](const std::exception_ptr& crash) {
            now.crash = now.crash ? now.crash : crash;
            --now.open;
        });
    }
    io_.restart();
    while (now.open != 0 && !now.crash && io_.run_one() != 0) {
    }
    if (now.crash) {
        std::rethrow_exception(now.crash);
    }
}

boost::asio::awaitable<void> pool::work(round& now, std::size_t slot) {
    for (;;) {
        if (const auto shard = now.all.next(slot, now.ms())) {
            now.progress[slot] = 0; // what it has done before counts in `done`
            co_await delegate(now, *shard);
            now.changed.cancel();
        } else if (now.all.finished()) {
            co_return;
        } else { // another slot's shard may be lost
            boost::system::error_code cancelled;
            co_await now.changed.async_wait(boost::asio::redirect_error(boost::asio::use_awaitable, cancelled));
        }
    }
}

boost::asio::awaitable<void> pool::delegate(round& now, std::size_t i) {
    auto options = cles::call_options{}.deadline(deadline_);
    if (progress_) {
        options.on_progress([&now, i](double part, std::string_view) { now.report_progress(i, part); });
    }
    const auto what = now.all.shards()[i].what; // the vector may grow while this waits
    while (now.all.shards()[i].fate == "open") {
        std::optional<cles::error> failure;
        const auto noun = now.all.shards()[i].target + ":sgd/train";
        try {
            auto part = co_await node_.async_delegate<sgd::trained>(noun, what, options);
            part.after_ms = now.ms();
            now.all.done(i, part);
        } catch (const cles::error& e) {
            failure = e;
        }
        if (failure && now.all.failed(i, *failure)) {
            const auto& shard = now.all.shards()[i];
            const bool lost = shard.fate == "lost";
            std::fprintf(stderr, "cles-dsgd: shard %zu: %s; %s%s\n", i + 1, shard.trouble.back().c_str(),
                         lost ? "its points are divided again" : "retrying at ", lost ? "" : shard.target.c_str());
            if (lost) {
                now.report_progress(i, 0);
                co_return;
            }
            boost::asio::steady_timer pause{io_, std::chrono::milliseconds{20}};
            co_await pause.async_wait(boost::asio::use_awaitable);
        } else if (failure) {
            node_.stop(); // cancels the others
        } else if (progress_) {
            now.report_progress(i, 1);
        }
    }
}

} // namespace dsgd
