// SPDX-License-Identifier: BSL-1.0
#include "mission.hpp"

#include "client/member_key.hpp"

#include <boost/asio/as_tuple.hpp>
#include <boost/asio/buffer.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/detached.hpp>
#include <boost/asio/read_until.hpp>

#include <algorithm>
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

// A feed that is slower is not silent between two updates.
double silent_after(const mission_options& args) {
    return std::max(1.0, 2 * static_cast<double>(args.every_ms) / 1000);
}

// Degrees, clockwise from north.
double course_of(const fmv::track& target) {
    const double course = std::atan2(target.ve, target.vn) * 180 / std::numbers::pi;
    return course < 0 ? course + 360 : course;
}

} // namespace

mission::mission(const mission_options& args)
    : args_(args), events_(args.name, args.json, args.audit), node_(io_, options_of(args)), feed_(silent_after(args)),
      run_(run_id()) {}

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
    events_.audit("begins", args_.name + (args_.keys.empty() ? " has no key" : " has the key of that member") + "; " +
                                (args_.has_operator ? "an operator" : "a script") + " decides");
    boost::asio::co_spawn(io_, watch(), boost::asio::detached);
    boost::asio::co_spawn(io_, search(), boost::asio::detached);
    boost::asio::co_spawn(io_, watch_feed(), boost::asio::detached);
    if (args_.has_operator) {
        boost::asio::co_spawn(io_, read_orders(), boost::asio::detached);
    }
    io_.run();
    const auto& all = commander_.fates();
    events_.log("report", text_of(all), all);
    return exit_code_of(all);
}

void mission::end() {
    ending_ = true;
    signals_.cancel();
    limit_.cancel();
    pause_.cancel();
    search_pause_.cancel();
    feed_pause_.cancel();
    boost::system::error_code ignored;
    keyboard_.close(ignored);
    node_.stop(); // open orders end as unknown
}

void mission::end_if_done() {
    const auto& all = commander_.fates();
    if (!ending_ && all.open == 0 && watched_ == 0 && (all.given >= args_.strikes || operator_gone_)) {
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

// Which nodes offer `strike`.
boost::asio::awaitable<void> mission::search() {
    while (!ending_) {
        for (auto& node : strikers_.update(node_.peers(), utc_now())) {
            boost::asio::co_spawn(io_, describe(std::move(node)), boost::asio::detached);
        }
        search_pause_.expires_after(milliseconds{100});
        co_await search_pause_.async_wait(boost::asio::as_tuple(boost::asio::use_awaitable));
    }
}

boost::asio::awaitable<void> mission::describe(std::string node) {
    const auto noun = node + ":cles";
    const auto options = cles::call_options{}.deadline(milliseconds{1000});
    bool known = false;
    try {
        const auto by_itself = co_await node_.async_pull<node_description>(noun, options);
        strikers_.described(node, by_itself);
        known = true;
    } catch (const cles::error&) { // it is asked again
    }
    if (!known) {
        strikers_.failed(node, utc_now());
    }
}

boost::asio::awaitable<void> mission::watch_feed() {
    while (!ending_) {
        feed_pause_.expires_after(milliseconds{100});
        co_await feed_pause_.async_wait(boost::asio::as_tuple(boost::asio::use_awaitable));
        if (const double now = utc_now(); !ending_ && feed_.shows_silence(now)) {
            const auto& seen = commander_.latest();
            events_.log(
                "silent",
                args_.recon_name + " is silent for " + fixed(feed_.silence(now), 1) + " s" +
                    (seen.tracks.empty() ? "" : ": its tracks are " + fixed(now - seen.captured, 1) + " s old"));
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
            feed_.ended();
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
    if (feed_.heard(received_utc_)) {
        events_.log("heard", args_.recon_name + " is not silent any more");
    }
    if (!what.trouble.empty()) {
        feed_.ended(); // it has no pictures to come
        report_error("no node processes the video of " + args_.recon_name + ": " + what.trouble);
    } else if (!error_.empty()) {
        error_.clear();
        events_.log("processing", what.by + " processes the video");
    }
    commander_.set_picture(std::move(what));
    if (args_.has_operator) {
        show();
    } else if (const auto target = commander_.select_target(args_.age_s);
               target && commander_.fates().given < args_.strikes && objection_to(*target, false).empty()) {
        decide(*target, false);
    }
}

std::string mission::objection_to(const fmv::track& target, bool again) const {
    return commander_.objection(target, again, utc_now(), args_.oldest_s);
}

void mission::report_error(const std::string& text) {
    if (text != std::exchange(error_, text)) {
        events_.log("trouble", text);
    }
}

void mission::decide(const fmv::track& target, bool again) {
    const auto& seen = commander_.latest();
    auto record = begin_story(seen, target, received_utc_, utc_now());
    record.order = args_.name + "-" + run_ + "-" + std::to_string(commander_.fates().given + 1);
    auto what = order_against(target, seen.captured, record.order);
    const double until = utc_now() + static_cast<double>(args_.deadline_ms) / 1000;
    what.until = until;
    what.picture = seen.by + " " + std::to_string(seen.frame);
    if (again) {
        what.again = true;
    }
    commander_.ordered(target);
    events_.log("decided",
                std::string{args_.has_operator ? "the operator" : "the script"} + " gives order " + record.order +
                    ": strike target " + std::to_string(target.id) + (again ? " again" : ""),
                record);
    if (events_.audit_is_broken()) {
        record.fate = "refused";
        record.trouble = "the audit file cannot be written";
        tell(record);
        end_if_done();
        return;
    }
    auto one = std::make_shared<open_order>(open_order{.what = std::move(what),
                                                       .record = std::move(record),
                                                       .round = order_round{until},
                                                       .sent_utc = utc_now(),
                                                       .sent = std::chrono::steady_clock::now()});
    std::erase_if(given_, [](const auto& each) { return each.expired(); });
    given_.push_back(one);
    boost::asio::co_spawn(io_, give(std::move(one)), boost::asio::detached);
}

// Not in the coroutine: g++ 12 warns about the allocation of its frame if that exceeds what Asio recycles.
void mission::tell(const story& record) {
    commander_.ended(record.fate);
    const auto whom = record.fate == "done"
                          ? " by " + record.struck_by + ", " + std::to_string(record.outcome.left) + " weapons left"
                          : ": " + record.trouble;
    const auto what = record.fate == "done" ? "released" : record.fate;
    events_.log("strike", "order " + record.order + " is " + what + whom, record, lines_of(record));
}

// Each node gets it once, and the next one only if it is certain that this one has not carried it out: people have to
// find out what happened to an order whose answer is lost.
boost::asio::awaitable<void> mission::give(std::shared_ptr<open_order> one) {
    auto& record = one->record;
    record.fate = "refused";
    while (!ending_ && !one->aborted && record.fate == "refused") {
        auto next = one->round.next(strikers_.candidates(utc_now()), utc_now());
        if (next.what == order_round::step::offer) {
            co_await offer(one, std::move(next.node));
        } else if (next.what == order_round::step::wait) {
            boost::asio::steady_timer pause{io_, milliseconds{20}};
            co_await pause.async_wait(boost::asio::as_tuple(boost::asio::use_awaitable));
        } else {
            break;
        }
    }
    if (one->aborted && (record.fate == "refused" || record.fate == "failed")) {
        record.fate = "aborted";
        record.trouble = "by the operator";
    } else if (record.fate == "refused") {
        record.trouble = one->round.trouble().empty() ? explain_no_striker() : one->round.trouble();
    }
    const bool released = record.fate == "done";
    const bool watches = released && !ending_;
    watched_ += watches ? 1U : 0U;
    tell(record);
    if (watches) {
        co_await assess(record);
        --watched_;
    } else if (released) {
        commander_.assessed(std::nullopt);
    }
    end_if_done();
}

boost::asio::awaitable<void> mission::offer(std::shared_ptr<open_order> one, std::string node) {
    auto& record = one->record;
    const auto left = std::chrono::duration<double>{one->round.until() - utc_now()};
    const auto limit = std::max(milliseconds{1}, std::chrono::duration_cast<milliseconds>(left));
    const auto options = cles::call_options{}.deadline(limit).urgent();
    const auto noun = node + ":strike";
    strikers_.gets_order(node);
    one->node = node;
    try {
        record.outcome = co_await node_.async_delegate<strike::outcome>(noun, one->what, options);
        const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - one->sent;
        record.fate = "done";
        record.trouble.clear(); // of those that refused it
        record.struck_by = record.outcome.node;
        record.strike_run_ms = record.outcome.run_ms;
        record.strike_way_ms = took.count() - record.strike_run_ms;
        record.data_to_answer_ms = (one->sent_utc - one->what.utc) * 1000 + took.count();
    } catch (const cles::error& e) {
        record.fate = fate_of(e);
        record.trouble = e.what();
        if (could_not_be_reached(e)) {
            strikers_.avoid(node, utc_now());
        }
    }
    one->node.clear();
    if (record.fate == "refused") {
        one->round.refused(record.trouble);
        events_.log("offered", "order " + record.order + " is refused by " + node + ": " + record.trouble);
    }
}

boost::asio::awaitable<void> mission::assess(story record) {
    const auto& what = record.outcome;
    const impact where{.by = record.processed_by,
                       .target = record.target,
                       .lat = what.aim_lat,
                       .lon = what.aim_lon,
                       .utc = what.impact_utc};
    const auto noun = args_.recon_name + ":impact";
    constexpr double margin_s = 5; // the answer comes after the impact
    const auto wait = std::chrono::duration<double>{std::max(0.0, what.impact_utc - utc_now()) + margin_s};
    const auto options = cles::call_options{}.deadline(std::chrono::duration_cast<milliseconds>(wait));
    try {
        const auto seen = co_await node_.async_push<assessment>(noun, where, options);
        commander_.assessed(seen.hit);
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
        commander_.assessed(std::nullopt);
        events_.log("assessed", "what became of order " + what.order + " is unknown: " + e.what());
    }
}

std::string mission::explain_no_striker() const {
    return node_.peers().empty() ? "no node answers at the given address (--strike): is clesd running there?"
                                 : "no known node offers 'strike': is libcles-strike.so among the plugins of a node" +
                                       std::string{args_.keys.empty() ? "?" : ", and may "} +
                                       (args_.keys.empty() ? "" : args_.name + " request it?");
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
    lines.emplace_back("strike NUMBER, confirm, hold, abort or quit:");
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
    using word = operator_command::word;
    const auto order = parse_command(line);
    switch (order.what) {
    case word::wrong:
        events_.log("operator",
                    "'" + std::string{line} + "' is not an order: write strike NUMBER, confirm, hold, abort or quit");
        break;
    case word::strike: read_back(order); break;
    case word::confirm: confirm(); break;
    case word::hold:
        events_.log("operator",
                    desk_.hold(utc_now()) ? "the order is held: confirm or abort" : "there is no order to hold");
        break;
    case word::abort: abort(); break;
    case word::quit: end(); break;
    }
}

void mission::read_back(const operator_command& order) {
    const auto number = std::to_string(order.target);
    const auto target = commander_.find(order.target);
    if (commander_.fates().given >= args_.strikes) {
        events_.log("operator", "no more orders: " + std::to_string(args_.strikes) + " were allowed (--strikes)");
    } else if (!target) {
        events_.log("operator", "there is no target " + number + " now");
    } else if (const auto why = objection_to(*target, order.again); !why.empty()) {
        events_.log("operator", why);
    } else if (const auto& seen = commander_.latest();
               !desk_.read_back({.by = seen.by, .target = order.target, .again = order.again}, utc_now())) {
        events_.log("operator", "another order is held: confirm or abort it first");
    } else {
        events_.log("read_back", "strike target " + number + (order.again ? " again" : "") + ", at " +
                                     fixed(target->lat, 5) + ", " + fixed(target->lon, 5) + " to " +
                                     fixed(target->sigma, 1) + " m, " + fixed(std::hypot(target->ve, target->vn), 0) +
                                     " m/s towards " + fixed(course_of(*target), 0) + " degrees, seen by " + seen.by +
                                     " in frame " + std::to_string(seen.frame) + ", " +
                                     fixed(utc_now() - seen.captured, 1) + " s ago: confirm, hold or abort");
    }
}

// The order is against the target, wherever it is by now.
void mission::confirm() {
    const auto order = desk_.confirm(utc_now());
    if (!order) {
        events_.log("operator", "there is no order to confirm");
        return;
    }
    const auto number = std::to_string(order->target);
    const auto target = commander_.latest().by == order->by ? commander_.find(order->target) : std::nullopt;
    if (!target) {
        events_.log("operator", "there is no target " + number + " now");
    } else if (const auto why = objection_to(*target, order->again); !why.empty()) {
        events_.log("operator", why);
    } else {
        decide(*target, order->again);
    }
}

void mission::abort() {
    if (desk_.abort(utc_now())) {
        events_.log("operator", "the order is aborted");
        return;
    }
    bool any = false;
    for (const auto& each : given_) {
        if (auto one = each.lock(); one && one->record.fate == "refused" && !std::exchange(one->aborted, true)) {
            any = true;
            boost::asio::co_spawn(io_, withdraw(std::move(one)), boost::asio::detached);
        }
    }
    events_.log("operator",
                any ? "the orders that have not been released are withdrawn" : "there is no order to abort");
}

// It counts as aborted only if its aircraft says that it has not released.
boost::asio::awaitable<void> mission::withdraw(std::shared_ptr<open_order> one) {
    if (one->node.empty()) {
        co_return;
    }
    const strike::word_on_order word{.order = one->record.order, .say = "abort"};
    const auto noun = one->node + ":strike";
    try {
        co_await node_.async_push(noun, word);
    } catch (const cles::error& e) {
        events_.log("operator", "order " + word.order + " cannot be aborted: " + e.what());
    }
}

} // namespace jadc2
