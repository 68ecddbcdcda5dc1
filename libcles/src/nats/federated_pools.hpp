// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/federation.hpp>
#include <cles/link.hpp>

#include "federation/bridge.hpp"
#include "federation/sealed_channel.hpp"
#include "nats/nats_connection.hpp"
#include "nats/pool_link.hpp"
#include "node/routing/other_pools.hpp"
#include "port/log_budget.hpp"

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/system/error_code.hpp>

#include <cstdint>
#include <deque>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles {
class json_writer;
}

namespace cles::nats {

/// The bridge of a node: connects the decisions (federation/bridge.hpp) to the node by links, and to NATS by a thread.
/// All of it runs on the node's executor.
class federated_pools final : public core::other_pools,
                              private bridging::bridge_output,
                              private bridging::bridge_trust,
                              private pool_link_owner,
                              public std::enable_shared_from_this<federated_pools> {
  public:
    explicit federated_pools(federation_options options);
    ~federated_pools() override;

    /// Returns false if another service uses it.
    [[nodiscard]] bool claim() noexcept { return !std::exchange(claimed_, true); }
    [[nodiscard]] const std::string& own_pool() const noexcept { return options_.pool; }
    /// The transport `pool` of the node.
    [[nodiscard]] std::unique_ptr<link_transport> make_transport();
    void write_metrics(json_writer& w) const;
    /// Whether the fleet is secured: then messages are sealed, and bridges authenticated.
    [[nodiscard]] bool is_secured() const noexcept { return is_secured_; }

    // core::other_pools
    void start(core::local_node& host) override;
    [[nodiscard]] std::string address_of(std::string_view target) const override;
    [[nodiscard]] std::vector<known_pool> list() const override;
    void on_security_changed() override;
    [[nodiscard]] bool has_left() const override { return stopped_; }

    // For the transport.
    void listen(const boost::asio::any_io_executor& executor, const limits& bounds);
    void accept(std::function<void(link_ptr)> on_link);
    void leave();
    std::function<void()> dial(const std::string& pool, const limits& bounds, dial_callback done);

  private:
    struct waiting_dial {
        std::uint64_t number;
        std::string pool;
        dial_callback done;
        time_point until;
    };

    // bridging::bridge_output
    bool publish(std::string subject, std::string reply, std::string message, room in) override;
    void subscribe(std::string subject, bool shared) override;
    void unsubscribe(const std::string& subject) override;
    void deliver(const bridging::bridge_link& on, std::string line) override;
    void end(const bridging::bridge_link& which) override;
    void lose_pool(std::string_view pool, std::string_view why) override;
    void lose_all(std::string_view why) override;
    void lose_binding(const bridging::bridge_link& on, const std::string& noun, std::string_view why) override;
    void on_pools_changed() override;
    [[nodiscard]] std::vector<std::string> home_names() const override;
    void log(log_level level, const std::string& text) override;

    // bridging::bridge_trust
    [[nodiscard]] bool may_forward(std::string_view member) const override;
    [[nodiscard]] std::string how_to_permit(std::string_view member) const override;
    [[nodiscard]] std::optional<protocol::failure> refusal(std::string_view member,
                                                           const protocol::request_line& bind) const override;
    [[nodiscard]] std::uint32_t roster_version() const override;
    void on_lost(const bridging::bridge_id& gone) override;
    void on_stated_roster(const bridging::bridge_id& by, std::uint32_t version) override;
    void on_stated_sessions(const bridging::bridge_id& by) override;

    // pool_link_owner
    void on_line(const bridging::bridge_link& from, std::string_view line) override;
    void schedule(std::shared_ptr<pool_link> which) override;
    void on_flushed() override;
    void on_closed(pool_link& which) override;
    [[nodiscard]] std::size_t unsent() const override;
    [[nodiscard]] std::uint64_t given() const override;

    void on_wake();
    void take_events();
    void on_event(const event& e);
    void on_connected(const event& e);
    void on_message(const event& e);
    void publish_questions();
    [[nodiscard]] bool waits_for_session();
    void run_later();
    void flush();
    void run();
    void run_batches();
    void hand_over_all();
    bool refuse(const bridging::bridge_link& on, std::string_view line);
    void answer_refused();
    void stop_if_finished();
    std::shared_ptr<pool_link> make_link(bridging::bridge_link which);
    template <class Condition>
    void lose_if(Condition concerns, std::string_view why);
    void set_timer();
    void on_timer(boost::system::error_code code);
    void serve_dials();
    [[nodiscard]] time_point now() const { return time_point::clock::now(); }

    const federation_options options_;
    boost::asio::any_io_executor executor_;
    // What the thread posts does not count as work while it waits for NATS.
    std::optional<boost::asio::executor_work_guard<boost::asio::any_io_executor>> work_;
    std::weak_ptr<core::local_node> host_;
    std::optional<bridging::bridge> bridge_;
    std::optional<bridging::sealed_channel> channel_; // in a secured fleet, of the last connection
    std::uint64_t connected_as_ = 0;                  // the instance on that
    nats_connection::handle connection_;
    std::optional<boost::asio::steady_timer> timer_;
    time_point timer_due_ = time_point::max();
    std::function<void(link_ptr)> on_link_;
    std::map<bridging::bridge_link, std::shared_ptr<pool_link>> links_;
    std::deque<std::shared_ptr<pool_link>> ready_; // have something for the node
    std::deque<event> events_;
    std::vector<std::pair<bridging::bridge_link, std::uint64_t>> refused_; // requests of other pools, by id
    std::uint64_t updates_dropped_ = 0;                                    // that the node's links did not take
    std::list<waiting_dial> dials_;
    std::string last_problem_;
    core::log_budget logged_; // since it was connected
    std::uint32_t last_link_ = 0;
    std::uint64_t last_dial_ = 0;
    bool claimed_ = false;
    bool is_secured_ = false;
    bool leaving_ = false;
    bool stopped_ = false;
    bool run_posted_ = false;
    bool running_ = false;
    bool was_slow_ = false;
    bool more_waits_ = false; // at the thread
};

} // namespace cles::nats
