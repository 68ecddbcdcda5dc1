// SPDX-License-Identifier: BSL-1.0
#include "platoon/drive/drive.hpp"

#include <cles/service.hpp>

#include "client/member_key.hpp"
#include "platoon/drive/child.hpp"
#include "platoon/drive/course.hpp"
#include "platoon/drive/laboratory_fleet.hpp"
#include "platoon/drive/next_state.hpp"
#include "platoon/drive/observer.hpp"
#include "platoon/drive/relay.hpp"
#include "platoon/drive/temporary_folder.hpp"
#include "platoon/drive/vehicle_networks.hpp"
#include "platoon/drive/vehicle_node.hpp"
#include "platoon/drive/view.hpp"
#include "platoon/driver/localization.hpp"

#include <boost/asio/co_spawn.hpp>
#include <boost/asio/signal_set.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/use_awaitable.hpp>

#include <algorithm>
#include <array>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <set>

#include <sys/wait.h>
#include <unistd.h>

namespace platoon {

namespace asio = boost::asio;
using namespace std::chrono_literals;

namespace {

constexpr auto poll_interval = 20ms;
constexpr auto discovery_time = 400ms;
constexpr double process_timeout = 10; // s
constexpr double gone_after = 2;       // s without an update of a vehicle that is not ours

/// With those that merge.
std::size_t all_vehicles(const drive_options& options) {
    return options.vehicles +
           static_cast<std::size_t>(std::count_if(options.incidents.begin(), options.incidents.end(),
                                                  [](const incident& e) { return e.what == incident::merge; }));
}

// In the folder of a fleet.
std::string keys_of(const std::string& member, const std::string& fleet) {
    return (std::filesystem::path{fleet} / member).string();
}

// Checks that everybody's keys are in the folder of the fleet.
void check_keys(const drive_options& options, const std::string& fleet) {
    std::string all;
    std::string missing;
    const auto check = [&](const std::string& name) {
        all.append(all.empty() ? "" : ",").append(name);
        if (!std::filesystem::exists(keys_of(name, fleet))) {
            missing.append(missing.empty() ? "" : ",").append(name);
        }
    };
    check(operator_name);
    for (std::size_t i = 0; i < all_vehicles(options); ++i) {
        check(name_of(i));
    }
    if (!missing.empty()) {
        throw cles::error(cles::errc::denied,
                          fleet + " has no keys of " + missing +
                              ": name the folder of a fleet, which 'cles fleet init DIR --with " + all +
                              "' creates; to an existing one, 'cles keys new' and 'cles fleet add' add members");
    }
}

// Under the table.
std::string last_lines(const std::vector<std::string>& all) {
    constexpr std::size_t most = 5;
    std::string text;
    for (std::size_t i = all.size() - std::min(all.size(), most); i < all.size(); ++i) {
        text += all[i];
    }
    return text;
}

bool has_faults(const drive_options& options) { return options.loss > 0 || options.delay > 0; }

/// What a drive with faults consists of, besides the vehicles.
struct faulty_network {
    explicit faulty_network(const drive_options& options) : networks(all_vehicles(options)) {
        const auto devices = networks.devices();
        std::string numbers;
        for (const int each : devices) {
            numbers.append(numbers.empty() ? "" : ",").append(std::to_string(each));
        }
        const auto text = [](double value) {
            std::array<char, 32> out{};
            std::snprintf(out.data(), out.size(), "%.17g", value);
            return std::string{out.data()};
        };
        relay.emplace(std::vector<std::string>{"relay", "--devices", numbers, "--listen", relay_url(), "--loss",
                                               text(options.loss * 100), "--burst", text(options.burst), "--delay",
                                               text(options.delay * 1000), "--seed", std::to_string(options.seed)},
                      -1, devices);
    }

    [[nodiscard]] std::string relay_url() const { return exchange_url(sockets.path(), relay_name); }
    [[nodiscard]] std::string url_of(const std::string& vehicle) const { return exchange_url(sockets.path(), vehicle); }

    vehicle_networks networks;
    temporary_folder sockets; ///< links without faults
    std::optional<child> relay;
};

cles::service_options options_of(const drive_options& options, const std::string& fleet) {
    std::string keys;
    if (!fleet.empty()) {
        check_keys(options, fleet);
        keys = keys_of(operator_name, fleet);
    }
    auto out = tool::options_of_member("platoon-" + std::to_string(::getpid()), keys);
    out.insecure = options.insecure;
    out.multicast = has_faults(options) ? cles::multicast_options{} : options.group;
    return out;
}

class drive_supervisor {
  public:
    explicit drive_supervisor(const drive_options& options)
        : options_(options), signals_(io_, SIGINT, SIGTERM),
          faults_(has_faults(options) ? std::make_unique<faulty_network>(options) : nullptr),
          laboratory_(options.secured ? std::make_unique<laboratory_fleet>(all_vehicles(options)) : nullptr),
          keys_(laboratory_ ? laboratory_->folder() : options.keys),
          limits_(limits_of(all_vehicles(options), options.differences, options.setup.limits, options.seed)),
          service_(io_, options_of(options, keys_)), open_(options.incidents) {
        signals_.async_wait([this](boost::system::error_code failed, int) { interrupted_ = !failed; });
    }

    recording run() {
        std::exception_ptr failure;
        asio::co_spawn(io_, supervise(), [&](const std::exception_ptr& why) {
            failure = why;
            service_.stop();
            io_.stop();
        });
        io_.run();
        if (failure) {
            std::rethrow_exception(failure);
        }
        return conclude();
    }

  private:
    asio::awaitable<void> pause(std::chrono::milliseconds time) {
        asio::steady_timer timer{io_, time};
        co_await timer.async_wait(asio::use_awaitable);
    }

    [[nodiscard]] double now() const { return static_cast<double>(monotonic_ns() - start_ns_) * 1e-9; }

    asio::awaitable<void> hear() {
        auto feed = co_await service_.async_bind<state_message>("all:state");
        for (;;) {
            const auto item = co_await next_state(feed);
            if (item.has_value()) {
                take(item.publisher, item.value);
                foreign_vehicle_ = children_.contains(item.publisher) ? foreign_vehicle_ : item.publisher;
            }
        }
    }

    void take(const std::string& from, const state_message& what) {
        if (const auto changed = observer_.take(from, to_state(what, start_utc_), now())) {
            tell(*changed);
            if (!children_.contains(from)) { // it sends no report
                events_.push_back(*changed);
            }
        }
    }

    // By its link without faults, as soon as it listens.
    asio::awaitable<void> hear_behind_relay(std::string name) {
        for (;;) {
            try {
                auto feed = co_await service_.async_bind<state_message>(
                    name + ":state", cles::bind_options{}.at(faults_->url_of(name), name));
                for (;;) {
                    const auto item = co_await next_state(feed);
                    if (item.has_value()) {
                        take(name, item.value);
                    }
                }
            } catch (const cles::error& e) {
                unheard_[name] = e.message(); // if it stays so, `wait_for_all` tells
            }
            co_await pause(poll_interval);
        }
    }

    asio::awaitable<void> supervise() {
        if (!faults_) {
            asio::co_spawn(io_, hear(), [this](const std::exception_ptr& why) { receive_failure_ = why; });
            co_await pause(discovery_time);
        }
        if (!foreign_vehicle_.empty()) {
            throw cles::error(cles::errc::busy, "another platoon uses this group (received " + foreign_vehicle_ +
                                                    "): choose another port with --multicast");
        }
        const std::size_t n = options_.vehicles;
        start_ns_ = monotonic_ns() + 1'500'000'000 + 200'000'000 * static_cast<std::int64_t>(n);
        start_utc_ = utc_at(start_ns_);
        const double speed = options_.setup.plan.speed;
        double x = 0;
        std::size_t previous = 0;
        for (std::size_t i = 0; i < n; ++i) {
            if (!joins(i)) {
                desired_.push_back(first_.empty() ? 0
                                                  : wanted_distance(options_.setup.spacing, speed, limits_[i].brake,
                                                                    limits_[previous].brake));
                x -= desired_.back();
                previous = i;
                start(i, x,
                      first_.empty() ? std::vector<std::string>{"--lead"}
                                     : std::vector<std::string>{"--ahead", first_.back()});
                first_.push_back(name_of(i));
            }
        }
        co_await wait_for_all();
        double shown = 0;
        const double late = std::max(0.0, now()); // a slow start of processes does not shorten the drive
        end_ = late + (options_.seconds > 0 ? options_.seconds : options_.setup.plan.end() + 5);
        while (!interrupted_ && now() < end_) {
            co_await pause(poll_interval);
            check_receiver();
            check_children();
            check_others();
            apply_incidents();
            if (now() >= shown + (options_.in_place ? 0.2 : 1)) {
                shown = now();
                show();
            }
        }
        end_ = std::min(end_, now()) - 2 / options_.setup.hz;
        if (faults_) {
            relayed_ =
                co_await service_.async_pull<relay_count>("self:links", cles::call_options{}.at(faults_->relay_url()));
        }
        co_await end_all();
    }

    void check_receiver() const {
        if (receive_failure_) {
            std::rethrow_exception(receive_failure_);
        }
    }

    asio::awaitable<void> wait_for_all() {
        for (;;) {
            co_await pause(poll_interval);
            check_receiver();
            check_children();
            const auto missing = std::find_if(first_.begin(), first_.end(), [this](const auto& name) {
                return observer_.book().last(name) == nullptr;
            });
            if (missing == first_.end() || interrupted_) {
                co_return;
            }
            if (observer_.book().has_ended(*missing)) {
                throw cles::error(cles::errc::unavailable, *missing + " did not start: " + last_line(*missing));
            }
            if (now() > process_timeout) {
                throw cles::error(cles::errc::deadline,
                                  *missing + " is not received: " +
                                      (faults_ ? unheard_[*missing]
                                               : "check that " + options_.group.interface + " supports multicast"));
            }
        }
    }

    [[nodiscard]] bool joins(std::size_t i) const {
        return std::any_of(options_.incidents.begin(), options_.incidents.end(),
                           [i](const incident& e) { return e.what == incident::join && e.vehicle == i; });
    }

    void start(std::size_t i, double x, const std::vector<std::string>& role_options) {
        const auto& setup = options_.setup;
        std::vector<std::string> words{"vehicle", "--name", name_of(i), "--report"};
        words.insert(words.end(), role_options.begin(), role_options.end());
        const auto add = [&](const char* option, const auto& value) {
            words.emplace_back(option);
            words.push_back(std::to_string(value));
        };
        add("--x", x);
        add("--turn", i);
        add("--turns", limits_.size());
        add("--start-ns", start_ns_);
        add("--start-utc", start_utc_);
        add("--lag", limits_[i].lag);
        add("--brake", limits_[i].brake);
        add("--hz", setup.hz);
        add("--brake-at", setup.plan.brake_at);
        add("--slow", setup.plan.slow);
        add("--slow-for", setup.plan.slow_for);
        add("--seed", options_.seed * 1000 + i);
        words.insert(words.end(), {"--controller", setup.uses_leader ? "leader" : "predecessor"});
        words.insert(words.end(),
                     {"--multicast", (faults_ ? radio_device : options_.group.interface) + "," + options_.group.group +
                                         ":" + std::to_string(options_.group.port)});
        if (!setup.radar.fitted) {
            words.emplace_back("--no-radar");
        }
        if (faults_) {
            words.insert(words.end(), {"--exchange", faults_->sockets.path()});
        }
        if (options_.insecure || (faults_ && keys_.empty())) { // nobody else is in that network
            words.emplace_back("--insecure");
        }
        if (!keys_.empty()) {
            words.insert(words.end(), {"--keys", keys_of(name_of(i), keys_)});
        }
        children_.try_emplace(name_of(i), words, faults_ ? faults_->networks.network_of(i) : -1);
        if (faults_) {
            asio::co_spawn(io_, hear_behind_relay(name_of(i)),
                           [this](const std::exception_ptr& why) { receive_failure_ = why ? why : receive_failure_; });
        }
    }

    void apply_incidents() {
        const double t = now();
        std::erase_if(open_, [&](const incident& e) {
            if (e.at > t) {
                return false;
            }
            const auto name = name_of(e.vehicle);
            const auto who = children_.find(name);
            if (e.what == incident::join) {
                start(e.vehicle, 0, {"--join"});
            } else if (e.what == incident::merge) {
                start(options_.vehicles + merged_++, 0, {"--behind", name});
            } else if (who != children_.end() && e.what == incident::vanish) {
                who->second.signal(SIGKILL);
                note(name, "killed", "as requested");
            } else if (who != children_.end()) {
                ask(name, e.what == incident::split ? "split" : "leave");
            }
            return true;
        });
    }

    void ask(const std::string& name, const std::string& task) {
        const auto how = faults_ ? cles::call_options{}.at(faults_->url_of(name), name) : cles::call_options{};
        service_.async_push(name + ":" + task, cles::json_text{"{}"}, how,
                            [this, name, task](boost::system::error_code failed, const cles::json_text&) {
                                if (failed) {
                                    note(name, "stays", "the request to " + task + " failed: " + failed.message());
                                }
                            });
    }

    void check_children() {
        if (faults_ && !faults_->relay->running()) {
            auto said = faults_->relay->errors();
            throw cles::error(cles::errc::unavailable, "the relay has ended: " + said.substr(0, said.find('\n')));
        }
        for (auto& [name, process] : children_) {
            if (process.running() || observer_.book().has_ended(name)) {
                continue;
            }
            const int status = process.status();
            const bool well = WIFEXITED(status) && WEXITSTATUS(status) == 0;
            observer_.record_end(name, well);
            disturbed_ = true;
            note(name, well ? "left" : "gone", well ? "ended normally" : exit_text(status) + last_line(name));
        }
    }

    // Vehicles of other hosts, or that somebody else has started.
    void check_others() {
        for (const auto& each : observer_.end_silent(now(), gone_after, own_names())) {
            tell(each);
            events_.push_back(each);
        }
    }

    [[nodiscard]] std::set<std::string> own_names() const {
        std::set<std::string> names;
        for (const auto& [name, process] : children_) {
            names.insert(name);
        }
        return names;
    }

    // If others have joined, those who are in the lane when the leader brakes are judged, from then on.
    void judge_all(course_setup& how) {
        const auto& names = how.all;
        if (std::all_of(names.begin(), names.end(), [this](const auto& name) { return children_.contains(name); })) {
            return;
        }
        const auto& plan = options_.setup.plan;
        how.begin = plan.brake_at;
        const auto lane = observer_.lane(how.begin);
        disturbed_ = disturbed_ || how.begin >= end_ || lane.size() < 2 || observer_.lane(end_) != lane;
        if (lane.size() >= 2) {
            how.first = lane;
            how.desired = observer_.desired(lane, how.spacing, plan.speed);
        }
    }

    static std::string exit_text(int status) {
        return WIFSIGNALED(status) ? "its process was ended by signal " + std::to_string(WTERMSIG(status)) + " "
                                   : "its process ended with " + std::to_string(WEXITSTATUS(status)) + " ";
    }

    [[nodiscard]] std::string last_line(const std::string& name) const {
        auto text = children_.at(name).errors();
        while (!text.empty() && text.back() == '\n') {
            text.pop_back();
        }
        return text.substr(text.rfind('\n') + 1);
    }

    void note(const std::string& vehicle, const std::string& what, const std::string& why) {
        events_.push_back({now(), vehicle, what, why});
        tell(events_.back());
    }

    void tell(const event& what) {
        if (!options_.quiet) {
            news_.push_back(line_of(what));
            if (!options_.in_place) {
                std::fputs(news_.back().c_str(), stdout);
                std::fflush(stdout);
            }
        }
    }

    void show() {
        if (options_.quiet) {
            return;
        }
        const auto names = observer_.vehicles();
        const double silent = driver::silent_after / options_.setup.hz;
        if (!options_.in_place) {
            std::fputs(line_of(observer_.book(), names, now(), options_.setup.spacing, silent).c_str(), stdout);
        } else {
            std::printf("\x1b[H\x1b[J%s%s",
                        table_of(observer_.book(), names, now(), options_.setup.spacing, silent).c_str(),
                        last_lines(news_).c_str());
        }
        std::fflush(stdout);
    }

    asio::awaitable<void> end_all() {
        for (auto& [name, process] : children_) {
            process.signal(SIGTERM);
        }
        const auto running = [this] {
            return std::any_of(children_.begin(), children_.end(), [](auto& one) { return one.second.running(); });
        };
        for (const double until = now() + process_timeout; running() && now() < until;) {
            co_await pause(poll_interval);
        }
    }

    recording conclude() {
        const auto& setup = options_.setup;
        course_setup how{.first = first_,
                         .desired = desired_,
                         .all = observer_.vehicles(),
                         .end = end_,
                         .spacing = setup.spacing,
                         .length = setup.limits.length,
                         .recovery = setup.plan.recovery()};
        judge_all(how);
        recording out = course_of(observer_.book(), how);
        out.verdict.ended = end_ >= setup.plan.end();
        out.source = "driven";
        out.vehicles = std::max(options_.vehicles, how.all.size());
        out.hz = setup.hz;
        out.loss = options_.loss;
        out.burst = options_.burst;
        out.delay_ms = options_.delay * 1000;
        out.spacing = setup.spacing;
        out.seed = options_.seed;
        out.steady = !disturbed_ && options_.incidents.empty();
        out.events = events_;
        std::vector<double> latencies;
        for (const auto& [name, process] : children_) {
            vehicle_report report;
            try {
                report = cles::from_json<vehicle_report>(process.output());
            } catch (const cles::error&) {
                continue; // it was killed, so there is no report
            }
            out.sent += report.sent;
            out.received += report.received;
            out.missed += report.missed;
            out.events.insert(out.events.end(), report.events.begin(), report.events.end());
            latencies.insert(latencies.end(), report.latency_us.begin(), report.latency_us.end());
        }
        std::sort(out.events.begin(), out.events.end(), [](const event& a, const event& b) { return a.t < b.t; });
        const auto count = [&out](const std::string& mode) {
            return static_cast<std::uint64_t>(std::count_if(out.events.begin(), out.events.end(),
                                                            [&mode](const event& e) { return e.mode == mode; }));
        };
        out.relayed = relayed_.delivered;
        out.lost = relayed_.lost;
        out.overflown = relayed_.overflown;
        out.fallbacks = count("fallback");
        out.radar_spells = count("radar");
        out.latency = summarise(std::move(latencies));
        return out;
    }

    const drive_options& options_;
    asio::io_context io_{1};
    asio::signal_set signals_;                     ///< before there are files that have to be removed in the end
    std::unique_ptr<faulty_network> faults_;       ///< null: none
    std::unique_ptr<laboratory_fleet> laboratory_; ///< if it was asked for
    std::string keys_;                             ///< the folder of the fleet; empty: without security
    std::vector<vehicle_limits> limits_;           ///< of each vehicle
    std::size_t merged_ = 0;                       ///< how many were started to merge
    observer observer_{options_.setup.law};
    cles::service service_;
    std::vector<incident> open_;
    std::map<std::string, child> children_;
    std::vector<std::string> first_; ///< the vehicles at the start, the leader first
    std::vector<double> desired_;    ///< the distance of each of them to the one ahead
    std::vector<event> events_;
    std::vector<std::string> news_; ///< the same, and changes of modes, in lines
    relay_count relayed_;
    std::map<std::string, std::string> unheard_; ///< why some could not be bound behind the relay
    std::string foreign_vehicle_;
    std::exception_ptr receive_failure_; ///< why updates are no longer received
    std::int64_t start_ns_ = 0;
    double start_utc_ = 0;
    double end_ = 0;
    bool interrupted_ = false, disturbed_ = false;
};

} // namespace

recording drive(const drive_options& options) { return drive_supervisor{options}.run(); }

} // namespace platoon
