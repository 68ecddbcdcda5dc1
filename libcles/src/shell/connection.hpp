// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/line_link.hpp>

#include "core/datagram_output.hpp"
#include "core/link_admission.hpp"
#include "core/link_monitor.hpp"
#include "core/outlet.hpp"
#include "core/session.hpp"
#include "core/source_life.hpp"
#include "core/topic.hpp"
#include "core/turns.hpp"

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace cles::core {
class feed_machine;
} // namespace cles::core

namespace cles::shell {

class local_node;

/// A link with the session that lives on it.
class connection final : public link_events,
                         public core::outlet,
                         public core::binder,
                         public core::turn_taker,
                         public core::link_admission::guest,
                         private core::link_monitor::owner,
                         private core::source_life::keeper,
                         public std::enable_shared_from_this<connection> {
  public:
    /// `refused`: it came in past the limit, and is told so.
    enum class origin : std::uint8_t { accepted, local, dialled, refused };

    /// `number`: none of the others of the service has it.
    connection(std::shared_ptr<local_node> host, link_ptr carrier, origin from, std::uint64_t number);
    ~connection() override;

    void start();
    [[nodiscard]] core::session& session() noexcept { return session_; }
    [[nodiscard]] origin from() const noexcept { return from_; }
    [[nodiscard]] std::uint64_t number() const noexcept { return number_; }
    /// It came in as a source of datagrams.
    [[nodiscard]] bool is_source() const noexcept { return life_.has_value(); }
    /// Nothing would be lost with it.
    [[nodiscard]] bool at_rest() const override { return session_.at_rest() && link_->unsent() == 0; }
    /// Whether requests can still be sent.
    [[nodiscard]] bool usable() const noexcept { return usable_; }
    // link_admission::guest, of a stream
    [[nodiscard]] const core::link_monitor& monitor() const override { return *monitor_; }
    void give_way() override;
    /// Ends it at once, without a word to its owner.
    void abandon(std::string_view why);
    /// Sends a BIND for a feed and follows it from then on.
    void bind(core::feed_machine& feed, protocol::request_text request, time_point deadline,
              detail::pending_ptr operation);
    void unbind(core::feed_machine& feed);
    /// Whether the peer says which update it answers BIND with; nothing as long as it has not been asked.
    [[nodiscard]] std::optional<bool> marks() const noexcept { return marks_; }
    void set_marks(bool does) noexcept { marks_ = does; }

    // link_events
    void on_line(std::string_view line) override;
    void on_overlong(std::string_view head) override;
    void on_cut(std::string_view rest) override;
    void on_batch() override;
    void on_end() override;
    void on_lost(boost::system::error_code why) override;
    void on_room() override;

    // turn_taker
    void flush() override;
    [[nodiscard]] bool write() override;
    [[nodiscard]] bool asks_alone() override { return session_.asking().in_flight() <= 1; }
    [[nodiscard]] std::shared_ptr<core::turn_taker> share() override { return shared_from_this(); }

    // outlet
    std::string& output() override { return link_->output(); }
    std::string& urgent_output() override { return link_->urgent_output(); }
    [[nodiscard]] std::shared_ptr<core::memory_account> memory() const override { return memory_; }
    [[nodiscard]] bool reserve(std::size_t more) override { return held_output_.try_resize(link_->unsent() + more); }
    [[nodiscard]] std::size_t datagram() const noexcept override { return link_->datagram(); }
    void wake() override;
    [[nodiscard]] bool is_behind() const override;
    void pause(bool stop) override;
    void finish() override;
    void close() override;
    void retire() override { usable_ = false; }

    // binder
    [[nodiscard]] bool takes_updates() const override;
    void put_updates(std::string_view lines) override;

  private:
    struct stall_watch final : core::deadline {
        explicit stall_watch(connection& c) : owner(c) {}
        void on_deadline(time_point now) override { owner.on_stall(now); }
        connection& owner;
        std::uint64_t sent = 0;
    };

    struct idle_watch final : core::deadline {
        explicit idle_watch(connection& c) : owner(c) {}
        void on_deadline(time_point now) override { owner.on_idle(now); }
        connection& owner;
        std::uint64_t moved = 0; // bytes, both ways
    };

    time_point now();
    /// The peer has said something. False where it has been turned away with it.
    bool hears(std::string_view text);
    void throw_on();
    void on_quiet() override;
    void on_silence() override;
    void on_probe() override;
    void on_stall(time_point now);
    void follow_buffers();
    void on_idle(time_point now);
    void send_output();
    [[nodiscard]] bool may_serve_more();
    void serve_more();
    void follow_backlog();
    void part(std::string_view why);
    void end(std::string_view why);
    void lose_feeds(std::string_view why);

    std::shared_ptr<local_node> host_;
    link_ptr link_;
    origin from_;
    std::uint64_t number_;
    std::shared_ptr<core::memory_account> memory_;
    core::memory_reservation held_output_{memory_};
    core::session session_;
    stall_watch stall_;
    idle_watch idle_;
    std::optional<core::datagram_output> datagrams_;
    std::optional<core::source_life> life_;     // of a source of datagrams
    std::optional<core::link_monitor> monitor_; // of a stream
    std::vector<core::feed_machine*> feeds_;
    std::optional<bool> marks_;
    std::optional<time_point> now_; // while a batch is handed over
    unsigned lines_ = 0;            // of this batch
    bool usable_ = true;
    bool finished_ = false; // the link was told to end
    bool gone_ = false;
    mutable bool updates_wait_ = false; // some were not taken
    bool pause_for_queue_ = false;
    bool pause_for_backlog_ = false;
};

} // namespace cles::shell
