// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/line_link.hpp>
#include <cles/log.hpp>

#include "node/base/peer_reply.hpp"
#include "node/flush_scheduler.hpp"
#include "node/session/link_monitor.hpp"
#include "node/session/link_peer.hpp"
#include "node/session/session.hpp"

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

class feed_machine;
class local_node;
class peer_channel;

/// A link and its session.
class connection final : public link_events,
                         public line_sink,
                         public subscriber,
                         public flushable,
                         private link_monitor::owner,
                         private link_peer::owner,
                         public std::enable_shared_from_this<connection> {
  public:
    /// `refused`: a source of datagrams beyond the limit, adopted only to be answered with `busy`.
    enum class origin : std::uint8_t { accepted, local, dialled, refused };

    /// `number` is unique within the service.
    [[gnu::cold]] connection(std::shared_ptr<local_node> host, link_ptr carrier, origin from, std::uint64_t number);
    [[gnu::cold]] ~connection() override;

    [[gnu::cold]] void start();
    [[nodiscard]] core::session& session() noexcept { return session_; }
    [[nodiscard]] origin from() const noexcept { return from_; }
    [[nodiscard]] std::uint64_t number() const noexcept { return number_; }
    [[nodiscard]] const identity& peer() const noexcept { return link_->peer(); }
    /// Whether it is a source of datagrams that was accepted.
    [[nodiscard]] bool is_source() const noexcept { return datagrams_ && monitor_; }
    /// Whether closing it would lose nothing.
    [[nodiscard]] bool is_idle() const override { return session_.is_idle() && link_->unsent() == 0; }
    /// Whether requests can still be sent.
    [[nodiscard]] bool usable() const noexcept { return usable_; }
    /// \pre it is a stream or a source
    [[nodiscard]] link_monitor& monitor() noexcept { return *monitor_; }
    /// Closes the link at once; `on_lost` is not called.
    [[gnu::cold]] void abandon(std::string_view why);
    /// Sends a BIND for `feed`, which receives the updates from then on.
    [[gnu::cold]] void bind(feed_machine& feed, protocol::outgoing_request request, time_point deadline,
                            detail::pending_ptr operation);
    [[gnu::cold]] void unbind(feed_machine& feed);
    /// The channel that has opened it, which knows what node it leads to.
    void set_channel(std::weak_ptr<const peer_channel> by) noexcept { channel_ = std::move(by); }
    /// Whether the peer is known to be a node of another process: others announce it, or it has authenticated itself.
    [[nodiscard]] bool is_node() const override;
    /// What the peer states about itself; null until it has been asked. Empty if it does not answer.
    [[nodiscard]] const peer_description* description() const noexcept {
        return node_there_ && node_there_->has_answered() ? &node_there_->description() : nullptr;
    }
    /// Asks the peer what it is, unless that has been done. `then` is called with the answer, or with the failure.
    /// \pre this node has opened it, and `description` is null
    void await_description(std::function<void(const peer_answer&)> then);
    /// A request of a client is about to be sent: a node is asked first what it reads.
    void prepare_to_forward();

    // link_events
    void on_line(std::string_view line) override;
    [[gnu::cold]] void on_overlong(std::string_view head) override;
    [[gnu::cold]] void on_cut(std::string_view rest) override;
    void on_batch() override;
    [[gnu::cold]] void on_end() override;
    [[gnu::cold]] void on_lost(boost::system::error_code why) override;
    void on_writable() override;
    [[gnu::cold]] void on_restart() override;
    [[gnu::cold]] void on_binding_lost(std::string_view noun, const std::string& why) override;
    [[gnu::cold]] void on_unanswered(bool lost) override;

    // flushable
    void flush() override;
    [[nodiscard]] bool write() override;
    [[nodiscard]] bool has_single_request() override { return session_.asking().in_flight() <= 1; }
    [[nodiscard]] bool has_single_message() override {
        return has_single_request() && session_.serving().in_flight() == 0;
    }
    [[nodiscard]] std::shared_ptr<flushable> share() override { return shared_from_this(); }

    // line_sink
    std::string& output() override { return link_->output(); }
    std::string& urgent_output() override { return link_->urgent_output(); }
    [[nodiscard]] std::shared_ptr<memory_account> memory() const override { return memory_; }
    [[nodiscard]] bool reserve(std::size_t more) override { return held_output_.try_resize(link_->unsent() + more); }
    [[nodiscard]] std::size_t datagram() const noexcept override { return link_->datagram(); }
    void wake() override;
    [[nodiscard]] bool is_behind() const override;
    void pause(bool stop) override;
    [[gnu::cold]] void finish() override;
    [[gnu::cold]] void close() override;
    void retire() override { usable_ = false; }
    void check_peer(time_point since) override { link_->check_peer(since); }
    [[gnu::cold]] void on_described(std::string_view json) override;

    // subscriber
    [[nodiscard]] bool takes_updates() const override;
    void put_updates(std::string_view lines) override;
    [[gnu::cold]] void on_denied() override;

  private:
    /// Watches whether bytes move.
    struct watch final : deadline {
        using function = void (connection::*)(time_point now);
        watch(connection& c, function expired) : owner(c), on_expiry(expired) {}
        void on_deadline(time_point now) override { (owner.*on_expiry)(now); }
        connection& owner;
        function on_expiry;
        std::uint64_t moved = 0; // bytes so far, when it was armed
    };

    time_point now();
    /// The peer has sent something. Returns false if that has been rejected, because the connection is refused.
    bool accept_input(std::string_view text);
    void rethrow_handler_exception();
    // link_monitor::owner
    [[gnu::cold]] void on_silence() override;
    [[gnu::cold]] void on_probe() override;
    [[gnu::cold]] void evict() override;

    // link_peer::owner
    [[nodiscard]] bool awaits_peer() const override;
    [[nodiscard]] link_traffic traffic() const override;
    [[gnu::cold]] void ask_peer() override;
    [[gnu::cold]] void on_hung() override;

    void learn();
    void on_answer(const peer_answer& found);
    void tell_waiting(const peer_answer& found);

    [[gnu::cold]] void on_stall(time_point now);
    /// \param kind as `caused_line::kind`
    [[gnu::cold]] void log_closed(log_level level, std::string_view kind, std::string_view what);
    void schedule_buffer_release();
    [[gnu::cold]] void on_idle(time_point now);
    void send_output();
    [[nodiscard]] bool may_serve_more();
    void serve_more();
    void update_backpressure();
    [[gnu::cold]] void close_after_flush(std::string_view why);
    [[gnu::cold]] void end(std::string_view why);
    [[gnu::cold]] void lose_feeds(std::string_view why);
    /// Those that are bound, of this noun; empty: of all.
    [[gnu::cold]] void lose_bound(std::string_view noun, const std::string& why);

    std::shared_ptr<local_node> host_;
    link_ptr link_;
    origin from_;
    std::uint64_t number_;
    std::shared_ptr<memory_account> memory_;
    memory_reservation held_output_{memory_};
    core::session session_;
    watch stall_{*this, &connection::on_stall}; // of bytes sent
    watch idle_{*this, &connection::on_idle};   // of bytes sent and received
    std::optional<datagram_output> datagrams_;
    std::optional<link_monitor> monitor_;   // of a stream, or a source of datagrams
    std::unique_ptr<link_peer> node_there_; // of a link that this node has opened, else null
    std::weak_ptr<const peer_channel> channel_;
    std::vector<std::function<void(const peer_answer&)>> waiting_; // for the description
    std::size_t questions_ = 0;                                    // to the peer, about itself, in flight
    std::vector<feed_machine*> feeds_;
    std::optional<time_point> now_; // cached while a batch is processed
    unsigned lines_ = 0;            // in this batch
    bool usable_ = true;
    bool finished_ = false; // the link is finishing
    bool gone_ = false;
    mutable bool updates_wait_ = false; // some were not accepted
    bool pause_for_queue_ = false;
    bool pause_for_backlog_ = false;
};

} // namespace cles::core
