// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/sharing.hpp>

#include "node/routing/service_registry.hpp"
#include "node/sharing/work_sharing.hpp"
#include "protocol/request_line.hpp"
#include "support/routing_fixture.hpp"

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::test {

/// A queue whose workers are those of the test.
class test_queue final : public shareable_queue {
  public:
    struct job {
        std::shared_ptr<core::call> call;
        std::string body;
        std::uint64_t ticket = 0; ///< of a moved job
    };

    [[nodiscard]] state read_state() const override {
        auto now = figures;
        now.waiting = static_cast<std::uint32_t>(waiting.size());
        now.movable = static_cast<std::uint32_t>(
            std::ranges::count_if(waiting, [](const job& each) { return each.call->movable() != nullptr; }));
        return now;
    }
    void offer(job_taker& to) override {
        std::vector<std::size_t> wanted;
        for (std::size_t i = 0; i < waiting.size() && !to.full(); ++i) {
            ++offered;
            if (to.choose(*waiting[i].call, i, service_time_of(*waiting[i].call))) {
                wanted.push_back(i);
            }
        }
        auto left = std::exchange(waiting, {});
        for (std::size_t i = 0; i < left.size(); ++i) {
            if (std::find(wanted.begin(), wanted.end(), i) == wanted.end()) {
                waiting.push_back(left[i]);
                continue;
            }
            auto call = left[i].call;
            auto body = left[i].body;
            moved.push_back({call, body, to.take(call, body, [this, call, body](bool refused) {
                                 ended += refused ? 0 : 1;
                                 std::erase_if(moved, [&](const job& each) { return each.call == call; });
                                 if (refused) {
                                     ++figures.movable_queued;
                                     waiting.push_back({call, body, 0});
                                 }
                             })});
        }
    }

    [[nodiscard]] std::chrono::microseconds service_time_of(const core::call& job) const {
        const auto* const r = job.movable();
        const auto found = r != nullptr ? by_task.find(r->path().substr(0, r->path().find('/'))) : by_task.end();
        return found != by_task.end() ? found->second : figures.service_time;
    }

    state figures{.workers = 1, .service_time = std::chrono::milliseconds{10}};
    std::map<std::string, std::chrono::microseconds, std::less<>> by_task; ///< service times that differ
    std::vector<job> waiting;
    std::vector<job> moved;
    int ended = 0;   ///< moved jobs that have been answered
    int offered = 0; ///< how often a job was
};

/// The node car1, which shares the jobs of a queue with car2; the test plays the others.
struct sharing_fixture : routing_fixture, private core::work_sharing::client {
    sharing_fixture() { start(); }
    sharing_fixture(std::shared_ptr<core::node_security> security, const std::string& client,
                    core::other_pools* pools = nullptr)
        : routing_fixture(std::move(security), client, pools) {
        start();
    }
    ~sharing_fixture() {
        if (sharing) {
            sharing->withdraw_all();
        }
    }

    /// A job for car1 arrives on the link, and waits.
    void submit(const std::string& line) {
        link.ask(line);
        if (!node.started.empty()) {
            queue.waiting.push_back({node.started.back()->call, node.started.back()->body, 0});
            ++queue.figures.movable_queued;
        }
    }
    /// The reply of car1 to a grant for so many jobs by car2.
    std::string grant(unsigned slots, const std::string& number = "00000000000000aa", const std::string& by = "car2") {
        return link.ask("PUSH self:cles/slots id=900 grant=" + number + R"( {"node":")" + by + R"(","free":)" +
                        std::to_string(slots) + "}");
    }
    /// The newest request to car2.
    [[nodiscard]] recorded_next_hop::sent& sent() { return ways.to("car2"); }
    /// The grant that car1 has sent to a node; empty: it has sent something else.
    std::string granted_to(const std::string& name) {
        const auto& text = ways.to(name).text;
        const auto at = text.find(" grant=");
        return text.starts_with("PUSH " + name + ":cles/slots") && at != std::string::npos ? text.substr(at + 7, 16)
                                                                                           : std::string{};
    }
    [[nodiscard]] core::counters& counts() const { return node.counts(); }

    test_queue queue;
    std::set<std::string> far; ///< nodes that are no neighbours
    std::unique_ptr<core::work_sharing> sharing =
        std::make_unique<core::work_sharing>(*node.host, static_cast<core::work_sharing::client&>(*this), queue, 7);

  private:
    void start() {
        node.on_later(verb::delegate, "work");
        offer("car2", task("DELEGATE", "work"), {.workers = 1});
    }

    [[nodiscard]] const core::service_registry* registry() const override { return &routing->registry(); }
    [[nodiscard]] bool is_neighbour(const core::known_node& other) const override { return !far.contains(other.name); }
    std::uint64_t forward(const core::forwarding_permit& permit, const protocol::outgoing_request& r, time_point due,
                          detail::pending_ptr reply, core::outbound::progress_function progress) override {
        return ways.forward(permit, r, due, std::move(reply), std::move(progress));
    }
    void send_own(const protocol::outgoing_request& r, time_point due, detail::pending_ptr reply) override {
        ways.send_own(r, due, std::move(reply));
    }
    void cancel(std::uint64_t ticket) override { ways.cancel(ticket); }
    std::uint32_t random() override { return ++drawn_; }

    std::uint32_t drawn_ = 0;
};

} // namespace cles::test
