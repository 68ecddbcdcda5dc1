// SPDX-License-Identifier: BSL-1.0
#include "pool.hpp"

#include "offers.hpp"

#include <boost/asio/bind_cancellation_slot.hpp>
#include <boost/asio/cancellation_signal.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/detached.hpp>
#include <boost/asio/redirect_error.hpp>
#include <boost/asio/steady_timer.hpp>

#include <algorithm>
#include <cstdio>
#include <exception>
#include <optional>
#include <utility>

#include <unistd.h>

namespace dsgd {

using steady = std::chrono::steady_clock;

struct pool::round {
    board& all;
    const char* what;
    boost::asio::steady_timer watching; ///< cancelled when nothing runs any more
    std::size_t running = 0;            ///< attempts
    std::size_t open = 0;               ///< coroutines
    std::exception_ptr crash{};
    std::map<std::size_t, boost::asio::cancellation_signal> withdrawals{}; ///< of attempts
    std::vector<double> progress{};                                        ///< of the shard of each slot, in points
    double done = 0;                                                       ///< of all, in points
    double reported = 0;                                                   ///< in percent
    char end_of_line = ::isatty(STDERR_FILENO) == 1 ? '\r' : '\n';
    steady::time_point begun = steady::now();

    round(boost::asio::io_context& io, board& work, const char* called) : all(work), what(called), watching(io) {}

    double ms() const { return std::chrono::duration<double, std::milli>(steady::now() - begun).count(); }

    void ended(const std::exception_ptr& why) {
        crash = crash ? crash : why;
        --open;
    }

    double& progress_of(std::size_t slot) {
        progress.resize(std::max(progress.size(), slot + 1)); // a node that joins has slots of its own
        return progress[slot];
    }

    void report_progress(std::size_t shard, double part) {
        const auto& entry = all.shards()[shard];
        const auto points = part * static_cast<double>(entry.what.count);
        done += points - std::exchange(progress_of(entry.slot), points);
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

std::map<std::string, sgd::recipe> pool::find() { return find_offers<sgd::recipe>(node_, "sgd", "libcles-sgd.so"); }

void pool::admit(const sgd::recipe& data, const std::vector<std::string>& members,
                 const std::vector<std::string>& names) {
    data_ = data;
    newcomers_ = newcomers{names};
    for (const auto& node : members) {
        newcomers_.joined(node, peer_of(node_, node).epoch);
    }
}

void pool::train(board& all, const char* what) {
    round now{io_, all, what};
    now_ = &now;
    for (const auto& member : newcomers_.members()) {
        all.join(member.first, peer_of(node_, member.first).load.workers);
    }
    begin(now);
    ++now.open;
    boost::asio::co_spawn(io_, watch(now), [&now](const std::exception_ptr& crash) { now.ended(crash); });
    io_.restart();
    while (now.open != 0 && !now.crash && io_.run_one() != 0) {
    }
    now_ = nullptr;
    if (now.crash) {
        std::rethrow_exception(now.crash);
    }
    const auto members = newcomers_.members();
    for (const auto& member : members) {
        if (!all.nodes().contains(member.first)) {
            newcomers_.left(member.first);
        }
    }
}

// All that nodes can begin now.
void pool::begin(round& now) {
    while (const auto attempt = now.all.next(now.ms())) {
        const auto& shard = now.all.shards()[now.all.attempts()[*attempt].shard];
        now.progress_of(shard.slot) = 0; // what the slot has done before counts in `done`
        start(now, *attempt);
    }
    if (now.running == 0) {
        now.watching.cancel();
    }
}

void pool::start(round& now, std::size_t attempt) {
    auto& withdrawal = now.withdrawals[attempt];
    ++now.running;
    ++now.open;
    boost::asio::co_spawn(
        io_, delegate(now, attempt),
        boost::asio::bind_cancellation_slot(withdrawal.slot(), [this, &now](const std::exception_ptr& crash) {
            now.ended(crash);
            --now.running;
            begin(now);
        }));
}

boost::asio::awaitable<void> pool::delegate(round& now, std::size_t attempt) {
    const auto shard = now.all.attempts()[attempt].shard;
    const auto what = now.all.shards()[shard].what; // the vectors may grow while this waits
    auto options = cles::call_options{}.deadline(deadline_);
    if (progress_ && now.all.shards()[shard].also.empty()) {
        options.on_progress([&now, shard](double part, std::string_view) {
            if (now.all.shards()[shard].fate == "open") {
                now.report_progress(shard, part);
            }
        });
    }
    for (bool again = true; again;) {
        std::optional<cles::error> failure;
        const auto noun = now.all.attempts()[attempt].target + ":sgd/train";
        try {
            auto part = co_await node_.async_delegate<sgd::trained>(noun, what, options);
            part.after_ms = now.ms();
            for (const auto other : now.all.done(attempt, part)) {
                now.withdrawals[other].emit(boost::asio::cancellation_type::terminal);
            }
        } catch (const cles::error& e) {
            failure = e;
        } catch (const boost::system::system_error& e) { // withdrawn before it had begun
            failure.emplace(e.code(), e.code().message());
        }
        if (!failure) {
            if (progress_) {
                now.report_progress(shard, 1);
            }
            co_return;
        }
        const auto known = now.all.shards()[shard].trouble.size();
        again = now.all.failed(attempt, *failure, now.ms());
        const auto& entry = now.all.shards()[shard];
        if (now.all.failure()) {
            node_.stop(); // cancels the others
            co_return;
        }
        if (entry.trouble.size() > known) {
            const bool divided = entry.fate == "lost";
            std::fprintf(stderr, "cles-dsgd: shard %zu: %s; %s%s\n", shard + 1, entry.trouble.back().c_str(),
                         again     ? "retrying at "
                         : divided ? "its points are divided again"
                                   : "another node has it, too",
                         again ? entry.target.c_str() : "");
            if (divided) {
                now.report_progress(shard, 0);
            }
        }
        if (again) {
            boost::asio::steady_timer pause{io_, std::chrono::milliseconds{20}};
            boost::system::error_code withdrawn;
            co_await pause.async_wait(boost::asio::redirect_error(boost::asio::use_awaitable, withdrawn));
            again = !now.all.attempts()[attempt].ended;
        }
    }
}

// Late shards, and nodes that come.
boost::asio::awaitable<void> pool::watch(round& now) {
    for (int turn = 0; now.running != 0; ++turn) {
        now.watching.expires_after(watch_interval);
        boost::system::error_code cancelled;
        co_await now.watching.async_wait(boost::asio::redirect_error(boost::asio::use_awaitable, cancelled));
        while (const auto attempt = now.all.late(now.ms())) {
            const auto& given = now.all.attempts()[*attempt];
            std::fprintf(stderr, "cles-dsgd: shard %zu is late: %s gets it as well\n", given.shard + 1,
                         given.target.c_str());
            start(now, *attempt);
        }
        if (turn % peers_every != 0 || now.all.failure()) {
            continue;
        }
        for (const auto& each : newcomers_.among(node_.peers())) {
            boost::asio::co_spawn(io_, meet(each.node, each.epoch), boost::asio::detached);
        }
    }
}

// May outlive the round, because nobody waits for it.
boost::asio::awaitable<void> pool::meet(std::string node, std::string epoch) {
    const auto options = cles::call_options{}.deadline(find_deadline);
    const auto noun = node + ":sgd";
    try {
        const auto data = co_await node_.async_pull<sgd::recipe>(noun, options);
        if (data != data_) {
            co_return;
        }
        newcomers_.joined(node, epoch);
        if (now_ != nullptr && now_->running != 0) {
            now_->all.join(node, peer_of(node_, node).load.workers);
            std::fprintf(stderr, "cles-dsgd: %s takes part from now on\n", cles::printable(node).c_str());
            begin(*now_);
        }
    } catch (const cles::error&) { // it does not offer the task, or is gone
    }
}

} // namespace dsgd
