// SPDX-License-Identifier: BSL-1.0
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"
#include "simulation/network/stream_half.hpp"
#include "simulation/workload/body.hpp"
#include "simulation/world/world.hpp"

#include <algorithm>
#include <deque>
#include <map>
#include <utility>
#include <vector>

namespace cles::simulation {
namespace {

using std::chrono::milliseconds;

/// A client on a stream that sends requests without ids, and knows which reply has to be next.
class talker final : public place, public link_events {
  public:
    enum class ending : std::uint8_t { stays, half_closes, leaves };
    struct manner {
        unsigned to = 0;
        std::uint32_t first_op = 0; ///< the number of its first request; the others follow
        unsigned lines = 0;
        milliseconds gap{0};  ///< between its lines
        milliseconds slow{0}; ///< how long it does not read
        ending end = ending::stays;
    };

    talker(network& net, unsigned host, dice style, manner how, const limits& bounds)
        : place(net.time(), host, "c" + std::to_string(host)), net_(net), style_(style), how_(how), bounds_(bounds),
          is_greedy_(style_.chance(250)) {}

    void start() {
        const auto self = shared_from_this();
        net_.dial(self, {how_.to, stream_listen_port}, bounds_,
                  [this](boost::system::error_code code, std::shared_ptr<stream_half> made) {
                      if (code) {
                          over_ = true;
                          return;
                      }
                      link_ = std::move(made);
                      link_->start(std::static_pointer_cast<talker>(shared_from_this()));
                      if (how_.slow.count() != 0) {
                          link_->pause(true);
                          later(how_.slow, [this] { link_->pause(false); });
                      }
                      say_next();
                  });
    }

    /// The node has crashed, so open requests may remain without a reply; or it may end the stream.
    void excuse() noexcept { excused_ = true; }
    [[nodiscard]] unsigned to() const noexcept { return how_.to; }
    /// All requests have to have their replies, unless the stream was lost. Then it closes its link.
    void judge_and_leave() {
        if (link_ == nullptr) {
            return;
        }
        if (!over_) {
            expect_answered(rule::ends_in_time, "so far");
        }
        if (!over_ && how_.end == ending::half_closes && !excused_) {
            complain(rule::ends_in_time, "the node has not ended the link");
        }
        over_ = true;
        link_->close();
    }

    void on_line(std::string_view line) override {
        // The node checks whether this link still works, or is about to leave.
        if (line.empty() || line.starts_with("PUSH self:cles/leaving")) {
            return;
        }
        if (!protocol::is_reply(line)) {
            on_update(line);
            return;
        }
        if (line.starts_with("{\"error\":\"busy\"") && line.find("many links") != std::string_view::npos) {
            excused_ = true;
            return;
        }
        if (expected_.empty()) {
            complain(rule::reply_order, "an answer that was not asked for: " + std::string{line});
            return;
        }
        const auto next = std::move(expected_.front());
        expected_.pop_front();
        on_answer(next, line);
    }

    void on_overlong(std::string_view head) override {
        complain(rule::well_formed, "a line is too long: " + std::string{head.substr(0, 80)});
    }

    void on_batch() override {}
    void on_end() override {
        // A node replies to all requests without ids before it ends the link.
        if (!link_->was_cut()) {
            expect_answered(rule::reply_order, "before the end");
        }
        over_ = true;
        link_->close();
    }
    void on_lost(boost::system::error_code) override {
        over_ = true;
        excused_ = excused_ || link_->was_cut();
        expect_answered(rule::reply_order, "before the loss");
    }
    void on_writable() override {}

  private:
    enum class kind : std::uint8_t { result, failure, unknown, malformed, bound };
    struct expected {
        kind what;
        std::uint32_t op;
        std::string noun; // the noun that was bound
    };

    void say_next() {
        if (over_) {
            return;
        }
        if (said_ == how_.lines) {
            end_talk();
            return;
        }
        ++said_;
        const auto op = std::to_string(how_.first_op + said_);
        const auto node = world::name_of(how_.to);
        if (is_greedy_) {
            constexpr unsigned long_answer = 1500;
            say("PULL " + node + ":echo/" + op + "/" + std::to_string(long_answer + style_.below(300)) + "\n",
                kind::result);
        } else {
            say_any(op, node);
        }
        if (how_.gap.count() == 0 && said_ < how_.lines) {
            say_next();
            return;
        }
        link_->flush();
        later(how_.gap, [this] { say_next(); });
    }

    void say_any(const std::string& op, const std::string& node) {
        switch (style_.below(12)) {
        case 0: say("PUSH " + node + ":store/" + op + "\n", kind::result); break;
        case 1:
            say("DELEGATE " + node + ":work/" + op + "/" + std::to_string(style_.below(100)) + " deadline=2000\n",
                kind::result);
            break;
        case 2: say("DELEGATE " + node + ":work/" + op + "/10/0/1 deadline=2000\n", kind::failure); break;
        case 3: say("DELEGATE self:work/" + op + "/10/0/2 deadline=150\n", kind::result); break;
        case 4: say("PULL " + node + "\n", kind::malformed); break;
        case 5: say("PULL " + node + ":unknown." + op + "\n", kind::unknown); break;
        case 6: say("PUSH " + node + ":keep/" + op + "/5 {\"op\":" + op + "}\r\n", kind::result); break;
        case 7:
            if (how_.end != ending::half_closes) { // a binding would keep the link open
                const auto noun = "fix/" + std::to_string(style_.below(3));
                say("BIND " + node + ":" + noun + "\n", kind::bound, noun);
                break;
            }
            [[fallthrough]];
        default:
            say("PULL " + node + ":echo/" + op + "/" + std::to_string(style_.chance(200) ? style_.below(1800) : 0) +
                    "\n",
                kind::result);
        }
    }

    void say(const std::string& line, kind what, std::string noun = {}) {
        expected_.push_back({what, how_.first_op + said_, std::move(noun)});
        link_->output().append(line);
    }

    void end_talk() {
        if (how_.end == ending::half_closes) {
            if (style_.chance(300)) { // in the middle of a line
                ++said_;
                say("PULL self:echo/1", kind::malformed);
            }
            link_->half_close();
        } else if (how_.end == ending::leaves) {
            over_ = true;
            link_->close();
        }
    }

    void on_answer(const expected& e, std::string_view line) {
        const auto unlike = [&] {
            complain(rule::reply_order,
                     "to request " + std::to_string(e.op) + " came " + std::string{line.substr(0, 120)});
        };
        if (!protocol::is_failure(line)) {
            if (e.what == kind::bound) {
                bound_.try_emplace(e.noun, 0);
                if (line.find("\"op\":") != std::string_view::npos) {
                    unlike();
                }
            } else if (e.what != kind::result || !speaks_of(line, e.op)) {
                unlike();
            }
            return;
        }
        protocol::failure why;
        protocol::parse_failure(line, why);
        const bool any_time = why.code == errc::busy || why.code == errc::deadline || why.code == errc::too_large;
        const bool names_it = why.message.find(std::to_string(e.op)) != std::string::npos;
        const bool fits = (e.what == kind::malformed && why.code == errc::bad_request) ||
                          (e.what == kind::unknown && why.code == errc::no_task && names_it) ||
                          (e.what == kind::failure && why.code == errc::failed && names_it);
        if (!fits && !(any_time && e.what != kind::malformed)) {
            unlike();
        }
    }

    void on_update(std::string_view line) {
        protocol::request_line update;
        protocol::malformed_request why;
        if (!protocol::parse_request(line, update, why) || !update.is_update()) {
            complain(rule::well_formed, "what came is no update: " + std::string{line});
            return;
        }
        const auto bound = bound_.find(std::string{update.noun.path});
        if (bound == bound_.end()) {
            complain(rule::update_order, "an update came before it was bound: " + std::string{line});
        } else if (*update.seq <= bound->second) {
            complain(rule::update_order, "an update came after a later one: " + std::string{line});
        } else {
            bound->second = *update.seq;
        }
    }

    void expect_answered(rule which, const char* when) {
        if (!expected_.empty() && !excused_) {
            complain(which, std::to_string(expected_.size()) + " requests were not answered " + when);
        }
    }

    void complain(rule which, const std::string& what) { net_.watcher().broken(which, name() + ": " + what); }

    network& net_;
    dice style_;
    manner how_;
    limits bounds_;
    bool is_greedy_; ///< sends many requests
    std::shared_ptr<stream_half> link_;
    std::deque<expected> expected_;
    std::map<std::string, std::uint64_t> bound_; // the last seq of each noun
    unsigned said_ = 0;
    bool excused_ = false;
    bool over_ = false;
};

class talking final : public part {
  public:
    using part::part;

    void perform(const action& a) override {
        constexpr std::uint32_t first = 1'000'000; // greater than those of the nodes' requests
        constexpr std::uint32_t apart = 1000;
        constexpr unsigned hosts_of_clients = 100;
        if (a.what == deed::jump) { // by its clock nothing has been accepted for long
            excuse(a["host"]);
        }
        if (a.what != deed::talk || world_.node(a["to"]) == nullptr) {
            return;
        }
        const talker::manner how{.to = a["to"],
                                 .first_op = first + a["op"] * apart,
                                 .lines = std::min(a["lines"], apart - 2),
                                 .gap = milliseconds{a["gap"]},
                                 .slow = milliseconds{a["slow"]},
                                 .end = static_cast<talker::ending>(a["end"] % 3)};
        const auto made = std::make_shared<talker>(world_.net(), hosts_of_clients + a["op"], dice{a["style"]}, how,
                                                   world_.node(a["to"])->bounds());
        talkers_.push_back(made);
        made->start();
    }

    void on_crash(node_run& n) override { excuse(n.host()); }
    void on_leaving(node_run& n) override { excuse(n.host()); }
    void wind_down() override {
        for (const auto& t : talkers_) {
            t->judge_and_leave();
        }
    }

  private:
    void excuse(unsigned host) {
        for (const auto& t : talkers_) {
            if (t->to() == host) {
                t->excuse();
            }
        }
    }

    std::vector<std::shared_ptr<talker>> talkers_;
};

} // namespace

std::unique_ptr<part> make_talking(world& in) { return std::make_unique<talking>(in); }

} // namespace cles::simulation
