// SPDX-License-Identifier: BSL-1.0
#include "mission.hpp"

#include <boost/asio/as_tuple.hpp>
#include <boost/asio/buffer.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/detached.hpp>
#include <boost/asio/read_until.hpp>

#include <charconv>
#include <chrono>
#include <cstdint>
#include <optional>
#include <utility>

#include <unistd.h>

namespace jadc2 {
namespace {

using std::chrono::milliseconds;

} // namespace

mission::mission(const mission_options& wanted)
    : wanted_(wanted), tell_(wanted.name, wanted.json), node_(io_, {.name = wanted.name,
                                                                    .peers = {{wanted.recon_name, wanted.recon}},
                                                                    .gossip = cles::gossip(wanted.strikers),
                                                                    .routing = cles::routing()}),
      run_(some_run()) {}

int mission::run() {
    signals_.async_wait([this](boost::system::error_code code, int) {
        if (!code) {
            end();
        }
    });
    if (wanted_.duration_s > 0) {
        limit_.expires_after(
            std::chrono::duration_cast<milliseconds>(std::chrono::duration<double>{wanted_.duration_s}));
        limit_.async_wait([this](boost::system::error_code code) {
            if (!code) {
                end();
            }
        });
    }
    boost::asio::co_spawn(io_, watch(), boost::asio::detached);
    if (wanted_.by_hand) {
        boost::asio::co_spawn(io_, read_orders(), boost::asio::detached);
    }
    io_.run();
    const auto& all = commander_.fates();
    tell_.tell("report",
               std::to_string(all.given) + " orders: " + std::to_string(all.done) + " done, " +
                   std::to_string(all.refused) + " refused, " + std::to_string(all.failed) + " failed, " +
                   std::to_string(all.unknown) + " unknown",
               all);
    return all.unknown != 0 ? 4 : all.failed != 0 ? 5 : all.refused != 0 || all.given == 0 ? 3 : 0;
}

void mission::end() {
    ending_ = true;
    signals_.cancel();
    limit_.cancel();
    pause_.cancel();
    boost::system::error_code ignored;
    keyboard_.close(ignored);
    node_.stop(); // orders that are open end as unknown
}

void mission::end_if_all_is_done() {
    const auto& all = commander_.fates();
    if (!ending_ && all.open == 0 && (all.given >= wanted_.strikes || operator_gone_)) {
        end();
    }
}

boost::asio::awaitable<void> mission::watch() {
    const auto noun = wanted_.recon_name + ":tracks";
    while (!ending_) {
        std::optional<cles::error> failure;
        try {
            auto tracks = co_await node_.async_bind<picture>(noun, cles::bind_options{}.keep(4));
            trouble_.clear();
            tell_.tell("bound", "bound to the tracks of " + wanted_.recon_name);
            co_await follow(std::move(tracks));
        } catch (const cles::error& e) {
            failure = e;
        }
        if (failure && !ending_) {
            tell_trouble("no tracks: " + std::string{failure->what()} + ": is cles-jadc2 recon running at " +
                         wanted_.recon + " (--recon)?");
            pause_.expires_after(milliseconds{200});
            co_await pause_.async_wait(boost::asio::as_tuple(boost::asio::use_awaitable));
        }
    }
}

boost::asio::awaitable<void> mission::follow(cles::feed<picture> tracks) {
    while (!ending_) {
        auto next = co_await tracks.async_next();
        switch (next.kind) {
        case cles::feed_event::update: see(std::move(next.value)); break;
        case cles::feed_event::current: break; // of nobody knows when
        case cles::feed_event::gap: tell_.tell("gap", std::to_string(next.missed) + " pictures were missed"); break;
        case cles::feed_event::lost:
            commander_.see({});
            tell_trouble(wanted_.recon_name + " is lost: " + next.text);
            break;
        case cles::feed_event::rebound:
            trouble_.clear();
            tell_.tell("rebound", wanted_.recon_name + " is back");
            break;
        }
    }
}

void mission::see(picture what) {
    received_utc_ = utc_now();
    if (!what.trouble.empty()) {
        tell_trouble(wanted_.recon_name + " has nobody who processes its video: " + what.trouble);
    } else if (!trouble_.empty()) {
        trouble_.clear();
        tell_.tell("processing", what.by + " processes the video");
    }
    commander_.see(std::move(what));
    if (wanted_.by_hand) {
        show();
    } else if (const auto target = commander_.worth_striking(wanted_.age);
               target && commander_.fates().given < wanted_.strikes) {
        decide(*target);
    }
}

void mission::tell_trouble(const std::string& text) {
    if (text != std::exchange(trouble_, text)) {
        tell_.tell("trouble", text);
    }
}

void mission::decide(const fmv::track& target) {
    const auto& seen = commander_.latest();
    auto told = begin_story(seen, target, received_utc_, utc_now());
    told.order = wanted_.name + "-" + run_ + "-" + std::to_string(commander_.fates().given + 1);
    const strike::order what{.id = told.order,
                             .x = target.x,
                             .y = target.y,
                             .vx = target.vx,
                             .vy = target.vy,
                             .utc = seen.captured,
                             .deadline_ms = wanted_.deadline_ms};
    commander_.ordered(target);
    tell_.tell("decided", "order " + told.order + ": strike target " + std::to_string(target.id), told);
    boost::asio::co_spawn(io_, give(what, std::move(told)), boost::asio::detached);
}

// Once: what became of an order whose answer is lost is for people to find out.
boost::asio::awaitable<void> mission::give(strike::order what, story told) {
    const auto options = cles::call_options{}.deadline(milliseconds{wanted_.deadline_ms}).urgent();
    const auto begun = std::chrono::steady_clock::now();
    const double sent = utc_now();
    try {
        told.outcome = co_await node_.async_delegate<strike::outcome>("any:strike", what, options);
        const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - begun;
        told.fate = "done";
        told.struck_by = told.outcome.node;
        told.strike_queue_ms = told.outcome.queue_ms;
        told.strike_run_ms = told.outcome.run_ms;
        told.strike_way_ms = took.count() - told.strike_queue_ms - told.strike_run_ms;
        told.data_to_answer_ms = (sent - what.utc) * 1000 + took.count();
    } catch (const cles::error& e) {
        told.fate = fate_of(e);
        told.trouble = explain(e);
    }
    commander_.ended(told.fate);
    const auto whom = told.fate == "done"
                          ? " by " + told.struck_by + ", " + std::to_string(told.outcome.left) + " weapons left"
                          : ": " + told.trouble;
    tell_.tell("strike", "order " + told.order + " is " + told.fate + whom + to_text(told), told);
    if (told.fate == "done" && !ending_) {
        co_await assess(told.outcome);
    }
    end_if_all_is_done();
}

boost::asio::awaitable<void> mission::assess(strike::outcome what) {
    const impact where{.x = what.aim_x, .y = what.aim_y, .utc = what.impact_utc};
    const auto noun = wanted_.recon_name + ":impact";
    try {
        const auto seen = co_await node_.async_push<assessment>(noun, where);
        tell_.tell("assessed",
                   "order " + what.order + (seen.hit ? " hits" : " misses") + ": " + fixed(seen.missed_by, 1) +
                       " pixels beside the target, " + fixed(what.flight_s, 2) + " s after its release",
                   seen);
    } catch (const cles::error& e) {
        tell_.tell("assessed", "order " + what.order + ": not seen: " + e.what());
    }
}

std::string mission::explain(const cles::error& why) const {
    if (why.code() != cles::errc::no_target) {
        return why.what();
    }
    return node_.peers().empty() ? "no node answers where it was told to ask (--strike): is clesd running there?"
                                 : why.message() + ": is libcles-strike.so among the plugins of a node?";
}

// Once a second: nobody reads faster.
void mission::show() {
    if (received_utc_ - shown_utc_ < 1) {
        return;
    }
    shown_utc_ = received_utc_;
    const auto& seen = commander_.latest();
    std::string text = std::to_string(seen.tracks.size()) + " targets";
    for (const auto& t : seen.tracks) {
        text += "\n    " + std::to_string(t.id) + "  at " + fixed(t.x, 0) + ", " + fixed(t.y, 0) + ", moving " +
                fixed(t.vx, 0) + ", " + fixed(t.vy, 0) + " pixels a second, followed for " + std::to_string(t.age) +
                " frames";
    }
    tell_.tell("picture", text + "\n    strike NUMBER, or quit:", seen);
}

boost::asio::awaitable<void> mission::read_orders() {
    boost::system::error_code wrong;
    keyboard_.assign(::dup(STDIN_FILENO), wrong);
    std::string text;
    while (!ending_ && !wrong) {
        const auto [code, size] =
            co_await boost::asio::async_read_until(keyboard_, boost::asio::dynamic_buffer(text, 4096), '\n',
                                                   boost::asio::as_tuple(boost::asio::use_awaitable));
        wrong = code;
        if (!code) {
            obey(std::string_view{text}.substr(0, size - 1));
            text.erase(0, size);
        }
    }
    if (!ending_) {
        operator_gone_ = true;
        tell_.tell("operator", "the operator has gone: " + wrong.message());
        end_if_all_is_done();
    }
}

void mission::obey(std::string_view line) {
    if (line == "quit") {
        end();
        return;
    }
    constexpr std::string_view word = "strike ";
    std::uint64_t id = 0;
    const auto number = line.substr(0, word.size()) == word ? line.substr(word.size()) : std::string_view{};
    const auto [end_of_number, code] = std::from_chars(number.data(), number.data() + number.size(), id);
    if (number.empty() || code != std::errc{} || end_of_number != number.data() + number.size()) {
        tell_.tell("operator", "'" + std::string{line} + "' is no order: strike NUMBER, or quit");
    } else if (commander_.fates().given >= wanted_.strikes) {
        tell_.tell("operator", "no more orders: " + std::to_string(wanted_.strikes) + " were allowed (--strikes)");
    } else if (const auto target = commander_.find(id)) {
        decide(*target);
    } else {
        tell_.tell("operator", "there is no target " + std::to_string(id) + " now");
    }
}

} // namespace jadc2
