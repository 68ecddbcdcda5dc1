// SPDX-License-Identifier: BSL-1.0
#include "mission.hpp"

#include "client/member_key.hpp"

#include <boost/asio/as_tuple.hpp>
#include <boost/asio/buffer.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/detached.hpp>
#include <boost/asio/read_until.hpp>

#include <charconv>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <optional>
#include <utility>

#include <fcntl.h>
#include <unistd.h>

namespace jadc2 {
namespace {

using std::chrono::milliseconds;

cles::service_options options_of(const mission_options& args) {
    auto out = tool::options_of_member(args.name, args.keys);
    out.peers = {{args.recon_name, args.recon}};
    out.gossip = cles::gossip(args.strikers);
    out.routing = cles::routing();
    return out;
}

// Degrees, clockwise from north.
double course_of(const fmv::track& target) {
    const double course = std::atan2(target.ve, target.vn) * 180 / std::numbers::pi;
    return course < 0 ? course + 360 : course;
}

} // namespace

mission::mission(const mission_options& args)
    : args_(args), events_(args.name, args.json), node_(io_, options_of(args)), run_(run_id()) {}

int mission::run() {
    signals_.async_wait([this](boost::system::error_code code, int) {
        if (!code) {
            end();
        }
    });
    if (args_.duration_s > 0) {
        limit_.expires_after(std::chrono::duration_cast<milliseconds>(std::chrono::duration<double>{args_.duration_s}));
        limit_.async_wait([this](boost::system::error_code code) {
            if (!code) {
                end();
            }
        });
    }
    boost::asio::co_spawn(io_, watch(), boost::asio::detached);
    if (args_.has_operator) {
        boost::asio::co_spawn(io_, read_orders(), boost::asio::detached);
    }
    io_.run();
    const auto& all = commander_.fates();
    events_.log("report",
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
    node_.stop(); // open orders end as unknown
}

void mission::end_if_done() {
    const auto& all = commander_.fates();
    if (!ending_ && all.open == 0 && (all.given >= args_.strikes || operator_gone_)) {
        end();
    }
}

boost::asio::awaitable<void> mission::watch() {
    const auto noun = args_.recon_name + ":tracks";
    while (!ending_) {
        std::optional<cles::error> failure;
        try {
            auto tracks = co_await node_.async_bind<picture>(
                noun, cles::bind_options{}.keep(1).every(milliseconds{args_.every_ms}));
            error_.clear();
            events_.log("bound", "bound to the tracks of " + args_.recon_name);
            co_await follow(std::move(tracks));
        } catch (const cles::error& e) {
            failure = e;
        }
        if (failure && !ending_) {
            report_error("no tracks: " + std::string{failure->what()} + ": is cles-jadc2 recon running at " +
                         args_.recon + " (--recon)?");
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
        case cles::feed_event::current: break; // of unknown age
        case cles::feed_event::gap: events_.log("gap", std::to_string(next.missed) + " pictures were missed"); break;
        case cles::feed_event::lost:
            commander_.set_picture({});
            report_error(args_.recon_name + " is lost: " + next.text);
            break;
        case cles::feed_event::rebound:
            error_.clear();
            events_.log("rebound", args_.recon_name + " is back");
            break;
        }
    }
}

void mission::see(picture what) {
    received_utc_ = utc_now();
    if (!what.trouble.empty()) {
        report_error("no node processes the video of " + args_.recon_name + ": " + what.trouble);
    } else if (!error_.empty()) {
        error_.clear();
        events_.log("processing", what.by + " processes the video");
    }
    commander_.set_picture(std::move(what));
    if (args_.has_operator) {
        show();
    } else if (const auto target = commander_.select_target(args_.age_s);
               target && commander_.fates().given < args_.strikes) {
        decide(*target);
    }
}

void mission::report_error(const std::string& text) {
    if (text != std::exchange(error_, text)) {
        events_.log("trouble", text);
    }
}

void mission::decide(const fmv::track& target) {
    const auto& seen = commander_.latest();
    auto record = begin_story(seen, target, received_utc_, utc_now());
    record.order = args_.name + "-" + run_ + "-" + std::to_string(commander_.fates().given + 1);
    auto what = order_against(target, seen.captured, record.order);
    commander_.ordered(target);
    events_.log("decided", "order " + record.order + ": strike target " + std::to_string(target.id), record);
    boost::asio::co_spawn(io_, give(what, std::move(record)), boost::asio::detached);
}

// Not in the coroutine: g++ 12 warns about the allocation of its frame if that exceeds what Asio recycles.
void mission::tell(const story& record) {
    commander_.ended(record.fate);
    const auto whom = record.fate == "done"
                          ? " by " + record.struck_by + ", " + std::to_string(record.outcome.left) + " weapons left"
                          : ": " + record.trouble;
    events_.log("strike", "order " + record.order + " is " + record.fate + whom, record, lines_of(record));
}

// Only once: people have to find out what happened to an order whose answer is lost.
boost::asio::awaitable<void> mission::give(strike::order what, story record) {
    const auto options = cles::call_options{}.deadline(milliseconds{args_.deadline_ms}).urgent();
    const auto begun = std::chrono::steady_clock::now();
    const double sent = utc_now();
    try {
        record.outcome = co_await node_.async_delegate<strike::outcome>("any:strike", what, options);
        const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - begun;
        record.fate = "done";
        record.struck_by = record.outcome.node;
        record.strike_run_ms = record.outcome.run_ms;
        record.strike_way_ms = took.count() - record.strike_run_ms;
        record.data_to_answer_ms = (sent - what.utc) * 1000 + took.count();
    } catch (const cles::error& e) {
        record.fate = fate_of(e);
        record.trouble = explain(e);
    }
    tell(record);
    if (record.fate == "done" && !ending_) {
        co_await assess(record);
    }
    end_if_done();
}

boost::asio::awaitable<void> mission::assess(story record) {
    const auto& what = record.outcome;
    const impact where{.by = record.processed_by,
                       .target = record.target,
                       .lat = what.aim_lat,
                       .lon = what.aim_lon,
                       .utc = what.impact_utc};
    const auto noun = args_.recon_name + ":impact";
    try {
        const auto seen = co_await node_.async_push<assessment>(noun, where);
        events_.log("assessed",
                    "order " + what.order + (seen.hit ? " hits" : " misses") + ": " + fixed(seen.missed_by, 1) +
                        " m from the " + (seen.is_target ? "target" : "nearest vehicle") + ", " +
                        fixed(what.flight_s, 2) + " s after its release; " + std::to_string(what.plots) + " plots of " +
                        what.node + " were fused with the track" +
                        (what.plots == 0
                             ? ": has its sensor the seed of " + args_.recon_name + ", and does it fuse (scans)?"
                             : ""),
                    seen);
    } catch (const cles::error& e) {
        events_.log("assessed", "order " + what.order + ": not seen: " + e.what());
    }
}

std::string mission::explain(const cles::error& why) const {
    if (why.code() != cles::errc::no_target) {
        return why.what();
    }
    return node_.peers().empty() ? "no node answers at the given address (--strike): is clesd running there?"
                                 : why.message() + ": is libcles-strike.so among the plugins of a node" +
                                       (args_.keys.empty() ? "?" : ", and may " + args_.name + " request it?");
}

// At most once per second, so that it can be read.
void mission::show() {
    if (received_utc_ - shown_utc_ < 1) {
        return;
    }
    shown_utc_ = received_utc_;
    const auto& seen = commander_.latest();
    event_log::lines lines;
    for (const auto& t : seen.tracks) {
        lines.push_back(std::to_string(t.id) + "  at " + fixed(t.lat, 5) + ", " + fixed(t.lon, 5) + " to " +
                        fixed(t.sigma, 1) + " m, " + fixed(std::hypot(t.ve, t.vn), 0) + " m/s towards " +
                        fixed(course_of(t), 0) + " degrees, followed for " + fixed(t.age, 1) + " s");
    }
    lines.emplace_back("strike NUMBER, or quit:");
    events_.log("picture", std::to_string(seen.tracks.size()) + " targets", seen, lines);
}

boost::asio::awaitable<void> mission::read_orders() {
    boost::system::error_code error;
    keyboard_.assign(::fcntl(STDIN_FILENO, F_DUPFD_CLOEXEC, 0), error);
    std::string text;
    while (!ending_ && !error) {
        const auto [code, size] =
            co_await boost::asio::async_read_until(keyboard_, boost::asio::dynamic_buffer(text, 4096), '\n',
                                                   boost::asio::as_tuple(boost::asio::use_awaitable));
        error = code;
        if (!code) {
            run_command(std::string_view{text}.substr(0, size - 1));
            text.erase(0, size);
        }
    }
    if (!ending_) {
        operator_gone_ = true;
        events_.log("operator", "the operator has left: " + error.message());
        end_if_done();
    }
}

void mission::run_command(std::string_view line) {
    if (line == "quit") {
        end();
        return;
    }
    constexpr std::string_view word = "strike ";
    std::uint64_t id = 0;
    const auto number = line.substr(0, word.size()) == word ? line.substr(word.size()) : std::string_view{};
    const auto [end_of_number, code] = std::from_chars(number.data(), number.data() + number.size(), id);
    if (number.empty() || code != std::errc{} || end_of_number != number.data() + number.size()) {
        events_.log("operator", "'" + std::string{line} + "' is not an order: write strike NUMBER, or quit");
    } else if (commander_.fates().given >= args_.strikes) {
        events_.log("operator", "no more orders: " + std::to_string(args_.strikes) + " were allowed (--strikes)");
    } else if (const auto target = commander_.find(id)) {
        decide(*target);
    } else {
        events_.log("operator", "there is no target " + std::to_string(id) + " now");
    }
}

} // namespace jadc2
