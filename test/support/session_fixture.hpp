// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/request.hpp>

#include "node/flush_scheduler.hpp"
#include "node/node_state.hpp"
#include "node/secured/secured_protocol.hpp"
#include "node/session/call.hpp"
#include "node/session/session.hpp"
#include "support/manual_clock.hpp"
#include "support/recorded_reply.hpp"
#include "support/recording_line_sink.hpp"
#include "support/reply_text.hpp"

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::test {

/// A node without a network, whose time the test advances.
class test_node {
  public:
    explicit test_node(limits bounds = {}, authoriser rules = {}, log_sink log = {},
                       core::completion_queue::runner complete = {}, std::shared_ptr<core::node_security> security = {},
                       const detail::tracing_part* tracing = nullptr, core::other_pools* pools = nullptr,
                       const detail::jobs_part* jobs = nullptr)
        : host(std::make_shared<core::node_state>(core::node_options{.name = "car1",
                                                                     .epoch = 0x5f3a09c1,
                                                                     .first_datagram_id = first_datagram_id,
                                                                     .bounds = bounds,
                                                                     .authorise = std::move(rules),
                                                                     .security = std::move(security),
                                                                     .secured = &core::make_secured_protocol,
                                                                     .pools = pools,
                                                                     .tracing = tracing,
                                                                     .jobs = jobs,
                                                                     .log = std::move(log),
                                                                     .complete = std::move(complete)},
                                                  clock, [this] { ++wakes; })) {}

    /// Advances time and runs what is due.
    void pass(std::chrono::milliseconds by) {
        clock.advance(by);
        host->deadlines.expire(clock.now());
    }

    /// What it says as a secured node. \pre it has security
    [[nodiscard]] core::secured_protocol& secured() const {
        return static_cast<core::secured_protocol&>(*host->secured);
    }

    using plain = std::function<void(const request&, json_writer&)>;
    void on(verb v, std::string_view task, plain handler) { host->tasks.add(v, task, {.plain = std::move(handler)}); }
    /// A task that replies with fixed JSON.
    void on(verb v, std::string_view task, std::string json) {
        on(v, task, [json = std::move(json)](const request&, json_writer& w) { w.raw(json); });
    }

    /// A handler that has started and has not replied.
    struct running {
        std::shared_ptr<core::call> call;
        std::vector<std::string> parameters;
        std::string body;
        bool stopped = false;
    };
    /// A task whose handlers wait in `started` until the test replies for them.
    void on_later(verb v, std::string_view task) {
        host->tasks.add(v, task, {.start = [this](const request& r, const std::shared_ptr<core::call>& call) {
                            auto entry = std::make_shared<running>();
                            entry->call = call;
                            for (const auto p : r.parameters()) {
                                entry->parameters.emplace_back(p);
                            }
                            entry->body = r.body();
                            call->on_stop([weak = std::weak_ptr{entry}] {
                                if (const auto alive = weak.lock()) {
                                    alive->stopped = true;
                                }
                            });
                            started.push_back(std::move(entry));
                        }});
    }
    void open(std::string_view task) { host->tasks.add(verb::bind, task, {}); }

    void publish(std::string_view path, std::string_view body) { host->published.publish_body(path, body); }
    /// What the service does when it is woken.
    void drain() { core::send_updates(host->unsent, host->published, clock.now()); }
    void publish_now(std::string_view path, std::string_view body) {
        publish(path, body);
        drain();
    }
    [[nodiscard]] core::counters& counts() const { return host->counts; }

    manual_clock clock;
    static constexpr std::uint64_t first_datagram_id = 5'000'000'000;
    int wakes = 0;
    std::shared_ptr<core::node_state> host;
    std::vector<std::shared_ptr<running>> started;
};

/// One link of a node, whose other end the test plays.
class test_link final : public recording_line_sink, public core::subscriber {
  public:
    explicit test_link(test_node& at) : test_link(at, 0) {}
    /// Over datagrams of this size, unless it is 0.
    test_link(test_node& at, std::size_t datagram) : test_link(at, datagram, {}) {}
    /// From a member of the fleet.
    test_link(test_node& at, std::string member) : test_link(at, 0, std::move(member)) {}
    test_link(test_node& at, std::size_t datagram, std::string member, std::string transport = "tcp",
              bool on_this_host = true)
        : recording_line_sink(datagram, std::make_shared<core::memory_account>(at.host->memory)),
          at_(at), peer_{.transport = std::move(transport),
                         .address = "tcp://127.0.0.1:1",
                         .name = std::move(member),
                         .uid = {},
                         .local = on_this_host},
          session_(at.host, *this, *this, peer_) {}

    /// Receives a line and returns what was sent meanwhile.
    std::string ask(std::string_view line) {
        session_.on_line(line, at_.clock.now());
        return take();
    }
    /// How often publishers of what it has bound have denied it later.
    int denials = 0;
    /// The same, for exactly one reply: "id=7 no_task", "ok", or "" for none.
    std::string kind(std::string_view line) { return kinds(ask(line)); }
    reply_parts reply(std::string_view line) {
        session_.on_line(line, at_.clock.now());
        const auto lines = take_lines();
        return lines.size() == 1 ? read_reply(lines[0])
                                 : reply_parts{.error = std::to_string(lines.size()) + " replies"};
    }
    /// What was sent, as "kind, kind, ...".
    std::string sent() { return kinds(take()); }

    void overlong(std::string_view head) { session_.on_overlong(head); }
    void half_close() { session_.on_end(); }
    void reset() { session_.on_lost("the link was lost"); }
    void turn() override {
        if (session_.serving().has_more()) {
            serve_more();
        }
    }
    /// The link has sent its output.
    void serve_more() { session_.serving().serve_more(at_.clock.now()); }
    /// The peer has ended in the middle of this line.
    void cut(std::string_view rest) { session_.on_cut(rest); }
    /// The link is writable again.
    void make_writable() {
        takes = true;
        session_.serving().drain(at_.clock.now());
    }
    [[nodiscard]] core::session& session() { return session_; }

    [[nodiscard]] bool takes_updates() const override { return takes; }
    void put_updates(std::string_view lines) override { output().append(lines); }
    void on_denied() override { ++denials; }

    bool takes = true;

  private:
    static std::string kinds(std::string_view text) {
        std::string all;
        while (!text.empty()) {
            const auto end = text.find('\n');
            all.append(all.empty() ? "" : ", ").append(kind_of(text.substr(0, end)));
            text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
        }
        return all;
    }

    test_node& at_;
    identity peer_;
    core::session session_;
};

} // namespace cles::test
