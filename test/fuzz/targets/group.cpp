// SPDX-License-Identifier: BSL-1.0
// What a node receives in its multicast group: a script, one step a line.
//
//   1BIND all:speed      a datagram of source 1 (a digit; 0 is the node itself)
//   !speed {"v":1}       the node publishes
//   +250                 milliseconds go by
//   *0                   its feed 0, 1 or 2 is opened, or closed if it is open
//   -                    the socket is not writable, or is again
//
// For every input, the node sends only BINDs of its feeds and its own updates, each in one datagram, no more of them
// than necessary, and stays within its limits.
#include <cles/error.hpp>
#include <cles/json_reader.hpp>

#include "fuzz/fuzz.hpp"
#include "node/flush_scheduler.hpp"
#include "node/publish/multicast_group.hpp"
#include "protocol/request_line.hpp"
#include "support/hear.hpp"
#include "support/manual_clock.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace cles::fuzz {
namespace {

constexpr std::size_t most_steps = 200;

// Small, so that a short script reaches them.
limits small_limits() {
    limits bounds;
    bounds.line = 2000;
    bounds.depth = 8;
    bounds.bindings = 3;
    bounds.nouns = 4;
    bounds.binding_bytes = 4000;
    bounds.group_leases = 6;
    bounds.publishers = 2;
    bounds.feed = 8;
    return bounds;
}

class output final : public core::group_port {
  public:
    void start(core::group_listener&) override {}
    core::datagrams_done send(core::datagram_list all) override {
        core::datagrams_done taken;
        for (; !all.empty(); all.drop_first()) {
            require(all.bytes().ends_with('\n'), "it consists of whole lines", all.bytes());
            check(all.first());
            taken.bytes += all.first().size();
            ++taken.count;
        }
        return taken;
    }
    void send_to(const core::group_source&, std::string_view) override {}
    void receive_own() override {}
    [[nodiscard]] std::size_t unsent() const noexcept override { return writable ? 0 : 1; }
    void close() override {}
    [[nodiscard]] const core::group_source& source() const noexcept override { return self_; }

    std::size_t updates = 0;
    std::size_t binds = 0;
    bool writable = true;

  private:
    void check(std::string_view line) {
        require(line.ends_with('\n') && line.size() <= protocol::datagram_bytes, "a line fits its datagram", line);
        protocol::request_line request;
        protocol::malformed_request why;
        require(protocol::parse_request(line.substr(0, line.size() - 1), request, why), "it can be read", line);
        if (request.is_update()) {
            require(request.noun.target == "car1", "an update is this node's own", line);
            require(is_valid_json(request.body, 64), "its body is JSON", line);
            ++updates;
        } else {
            require(request.verb == verb::bind, "all else is a BIND", line);
            ++binds;
        }
    }

    core::group_source self_{.address = 0x7f000001, .port = 0};
};

class listener final : public core::announcement_listener {
  public:
    void on_solicitation(bool, time_point) override {}
    void on_announcement(core::heard_announcement heard, time_point) override {
        require(heard.from.port != 0, "a node does not hear itself");
        require(!protocol::is_reserved_target(heard.said.node), "it is of a node", heard.said.node);
    }
};

class watched_group {
  public:
    watched_group() {
        group_.set_listener(&presence_);
        for (const auto& [target, path] :
             {std::pair{"all", "speed"}, std::pair{"car2", "speed"}, std::pair{"all", "a/b"}}) {
            feeds_.push_back(std::make_unique<core::group_feed>(node_.bounds, node_.completions, target, path));
        }
        open_.fill(false);
    }
    ~watched_group() {
        for (const auto& feed : feeds_) {
            group_.feeds().remove(*feed);
        }
        session_.bindings().clear();
        require(node_.deadlines.size() == 0, "nothing is left behind");
    }
    watched_group(const watched_group&) = delete;
    watched_group& operator=(const watched_group&) = delete;

    void step(std::string_view line) {
        if (line.empty()) {
            return;
        }
        const auto kind = line.front();
        const auto rest = line.substr(1);
        if (kind >= '0' && kind <= '9') {
            hear(static_cast<std::uint16_t>(kind - '0'), rest);
        } else if (kind == '!') {
            publish(rest);
        } else if (kind == '+') {
            pass(rest);
        } else if (kind == '*' && rest.size() == 1 && rest[0] >= '0' && rest[0] <= '2') {
            toggle(static_cast<std::size_t>(rest[0] - '0'));
        } else if (kind == '-') {
            out_.writable = !out_.writable;
            session_.bindings().drain(clock_.now());
        }
        check();
    }

  private:
    void hear(std::uint16_t source, std::string_view datagram) {
        const auto updates = out_.updates;
        const auto binds = out_.binds;
        const auto waiting = published_ - drained_;
        cles::test::hear(session_, {.address = 0x7f000001, .port = source}, datagram);
        require(out_.updates <= updates + 1 + waiting, "a datagram has one update repeated at most", datagram);
        require(out_.binds == binds, "a datagram has nothing bound", datagram);
        require(source != 0 || out_.updates == updates, "a node does not hear itself", datagram);
    }
    void publish(std::string_view text) {
        const auto space = std::min(text.find(' '), text.size());
        const auto path = text.substr(0, space);
        const auto body = text.substr(std::min(space + 1, text.size()));
        const auto whole = "self:" + std::string{path};
        protocol::noun_view noun;
        std::string why;
        std::string scratch;
        if (!protocol::parse_noun(whole, noun, why) || noun.task == "cles" || !is_valid_json(body, 8)) {
            return;
        }
        try {
            node_.published.publish_body(protocol::canonical_path(noun, scratch), body);
            ++published_;
        } catch (const error&) { // a limit is exceeded
            return;
        }
        core::send_updates(node_.unsent, node_.published, clock_.now());
        if (out_.writable) {
            drained_ = published_;
        }
    }
    void pass(std::string_view digits) {
        unsigned span = 0;
        std::from_chars(digits.data(), digits.data() + digits.size(), span);
        clock_.advance(std::chrono::milliseconds{std::min(span, 100'000U)});
        node_.deadlines.expire(clock_.now());
    }
    void toggle(std::size_t which) {
        if (open_[which]) {
            group_.feeds().remove(*feeds_[which]);
        } else {
            group_.feeds().add(*feeds_[which], clock_.now());
        }
        open_[which] = !open_[which];
    }
    void check() {
        const auto& bounds = node_.bounds;
        require(node_.counts.group_leases <= bounds.group_leases, "leases are bounded");
        require(node_.counts.group_dropped <= node_.counts.group_received, "what is dropped was received");
        require(node_.deadlines.size() <= 2 * bounds.group_leases + feeds_.size(), "deadlines are bounded");
        for (const auto& feed : feeds_) {
            require(feed->publishers() <= bounds.publishers, "publishers are bounded");
        }
    }

    test::manual_clock clock_;
    std::shared_ptr<core::node_state> shared_node_ = std::make_shared<core::node_state>(
        core::node_options{.name = "car1", .epoch = 1, .bounds = small_limits()}, clock_, [] {});
    core::node_state& node_ = *shared_node_;
    output out_;
    listener presence_;
    core::multicast_group group_{shared_node_, 1};
    core::group_session session_{shared_node_, group_, {std::shared_ptr<void>{}, &out_}, 1};
    std::vector<std::unique_ptr<core::group_feed>> feeds_;
    std::array<bool, 3> open_{};
    std::size_t published_ = 0;
    std::size_t drained_ = 0;
};

} // namespace

void run(std::string_view input) {
    watched_group group;
    for (std::size_t steps = 0; !input.empty() && steps < most_steps; ++steps) {
        const auto end = std::min(input.find('\n'), input.size());
        group.step(input.substr(0, end));
        input.remove_prefix(std::min(end + 1, input.size()));
    }
}

} // namespace cles::fuzz
