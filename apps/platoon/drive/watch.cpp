// SPDX-License-Identifier: BSL-1.0
#include "platoon/drive/watch.hpp"

#include <cles/service.hpp>

#include "client/member_key.hpp"
#include "platoon/drive/course.hpp"
#include "platoon/drive/next_state.hpp"
#include "platoon/drive/observer.hpp"
#include "platoon/drive/vehicle_node.hpp"
#include "platoon/drive/view.hpp"
#include "platoon/driver/localization.hpp"

#include <boost/asio/awaitable.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/signal_set.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/use_awaitable.hpp>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstddef>
#include <cstdio>
#include <exception>
#include <iterator>
#include <vector>

#include <unistd.h>

namespace platoon {

namespace asio = boost::asio;
using namespace std::chrono_literals;

namespace {

constexpr auto look_interval = 20ms;
constexpr double first_look = 1;     // s, after which all vehicles have been received
constexpr double silent_time = 0.5;  // s; five updates at 10 Hz
constexpr double over_after = 2;     // s without an update
constexpr double braked_by = 1;      // m/s, of the leader: a manoeuvre has begun
constexpr double recovered_to = 0.5; // m/s, of its first speed
constexpr double longest_course = logbook::longest;
constexpr std::ptrdiff_t most_events = 10'000; // then the older half is forgotten

cles::service_options watcher_options(const watch_options& options) {
    auto out = tool::options_of_member("watch-" + std::to_string(::getpid()), options.keys);
    out.insecure = options.insecure;
    out.multicast = options.group;
    return out;
}

class platoon_watch {
  public:
    explicit platoon_watch(const watch_options& options)
        : options_(options), signals_(io_, SIGINT, SIGTERM), service_(io_, watcher_options(options)),
          start_ns_(monotonic_ns()), start_utc_(utc_at(start_ns_)) {
        signals_.async_wait([this](boost::system::error_code failed, int) { interrupted_ = !failed; });
    }

    recording run() {
        const auto ended = [this](const std::exception_ptr& why) {
            failure_ = failure_ ? failure_ : why;
            service_.stop();
            io_.stop();
        };
        asio::co_spawn(io_, hear(), ended);
        asio::co_spawn(io_, show(), ended);
        io_.run();
        if (failure_) {
            std::rethrow_exception(failure_);
        }
        return conclude();
    }

  private:
    [[nodiscard]] double now() const { return static_cast<double>(monotonic_ns() - start_ns_) * 1e-9; }

    asio::awaitable<void> hear() {
        auto feed = co_await service_.async_bind<state_message>("all:state");
        for (;;) {
            const auto item = co_await next_state(feed);
            if (!item.has_value()) {
                continue;
            }
            if (const auto changed = observer_.take(item.publisher, to_state(item.value, start_utc_), now())) {
                tell(*changed);
            }
        }
    }

    asio::awaitable<void> show() {
        asio::steady_timer timer{io_};
        for (double shown = 0; !interrupted_ && (options_.seconds == 0 || now() < options_.seconds);) {
            timer.expires_after(look_interval);
            co_await timer.async_wait(asio::use_awaitable);
            for (const auto& each : observer_.end_silent(now(), over_after)) {
                changed_ = true;
                tell(each);
            }
            if (first_.empty() && now() >= first_look) {
                begin();
            }
            if (!options_.quiet && now() >= shown + (options_.in_place ? 0.2 : 1)) {
                shown = now();
                print();
            }
        }
        end_ = now();
    }

    void begin() {
        begun_ = now();
        first_ = observer_.lane(begun_);
        if (first_.empty()) {
            throw cles::error(cles::errc::no_target, "there is no platoon: no vehicle was found in the group " +
                                                         options_.group.group + ":" +
                                                         std::to_string(options_.group.port));
        }
        desired_ = observer_.desired(first_, options_.setup.spacing, options_.setup.plan.speed);
    }

    void tell(const event& what) {
        if (std::ssize(events_) == most_events) {
            events_.erase(events_.begin(), events_.begin() + most_events / 2);
        }
        events_.push_back(what);
        if (!options_.quiet && !options_.in_place) {
            std::fputs(line_of(what).c_str(), stdout);
            std::fflush(stdout);
        }
    }

    void print() const {
        const auto names = observer_.vehicles();
        if (!options_.in_place) {
            std::fputs(line_of(observer_.book(), names, now(), options_.setup.spacing, silent_time).c_str(), stdout);
        } else {
            std::printf("\x1b[H\x1b[J%s",
                        table_of(observer_.book(), names, now(), options_.setup.spacing, silent_time).c_str());
            constexpr std::size_t most = 5;
            for (std::size_t i = events_.size() - std::min(events_.size(), most); i < events_.size(); ++i) {
                std::fputs(line_of(events_[i]).c_str(), stdout);
            }
        }
        std::fflush(stdout);
    }

    recording conclude() {
        if (first_.empty()) {
            begin();
        }
        const double from = std::max(begun_, end_ - longest_course);
        auto out = course_of(observer_.book(), {.first = first_,
                                                .desired = desired_,
                                                .all = observer_.vehicles(),
                                                .from = from,
                                                .end = end_,
                                                .begin = from,
                                                .spacing = options_.setup.spacing,
                                                .length = options_.setup.limits.length,
                                                .recovery = INFINITY});
        out.source = "watched";
        out.vehicles = observer_.vehicles().size();
        out.spacing = options_.setup.spacing;
        out.steady = !changed_ && observer_.lane(end_) == first_;
        out.events = events_;
        out.verdict.ended = has_braked_and_recovered(out);
        return out;
    }

    [[nodiscard]] bool has_braked_and_recovered(const recording& of) const {
        const auto leader = std::find_if(of.courses.begin(), of.courses.end(),
                                         [this](const auto& each) { return each.vehicle == first_.front(); });
        if (leader == of.courses.end()) {
            return false;
        }
        double fastest = NAN;
        double slowest = NAN;
        for (const double speed : leader->speed) {
            fastest = std::fmax(fastest, speed);
            slowest = std::isnan(fastest) || fastest - speed < braked_by ? slowest : std::fmin(slowest, speed);
        }
        return !std::isnan(slowest) && leader->speed.back() >= fastest - recovered_to;
    }

    const watch_options& options_;
    asio::io_context io_{1};
    asio::signal_set signals_;
    cles::service service_;
    std::int64_t start_ns_;
    double start_utc_;
    observer observer_{options_.setup.law};
    std::vector<std::string> first_; ///< the vehicles at the beginning
    std::vector<double> desired_;
    std::vector<event> events_;
    std::exception_ptr failure_;
    double begun_ = 0, end_ = 0;
    bool interrupted_ = false, changed_ = false;
};

} // namespace

recording watch(const watch_options& options) { return platoon_watch{options}.run(); }

} // namespace platoon
