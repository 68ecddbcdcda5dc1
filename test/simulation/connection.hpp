// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/link.hpp>

#include "core/datagram_output.hpp"
#include "core/feed_machine.hpp"
#include "core/outlet.hpp"
#include "core/session.hpp"
#include "core/source_life.hpp"
#include "core/topic.hpp"
#include "core/turns.hpp"

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cles::simulation {

class node_run;

/// A link of a simulated node with the session that lives on it: does for the machines what shell/connection.hpp does,
/// in virtual time. The two are to be kept alike.
class connection final : public link_events,
                         public core::outlet,
                         public core::binder,
                         public core::turn_taker,
                         private core::source_life::keeper,
                         public std::enable_shared_from_this<connection> {
  public:
    enum class origin : std::uint8_t { accepted, dialled, refused };

    connection(node_run& host, link_ptr carrier, origin from);
    ~connection() override;

    void start() { link_->start(shared_from_this()); }
    [[nodiscard]] core::session& session() noexcept { return session_; }
    [[nodiscard]] origin from() const noexcept { return from_; }
    [[nodiscard]] bool is_source() const noexcept { return from_ == origin::accepted && datagrams_.has_value(); }
    [[nodiscard]] bool at_rest() const override { return session_.at_rest() && link_->unsent() == 0; }
    [[nodiscard]] bool usable() const noexcept { return usable_; }
    [[nodiscard]] std::size_t unsent() const noexcept { return link_->unsent(); }
    void abandon(std::string_view why);
    /// The process is gone: the system closes the link, and nobody here hears of it.
    void vanish();
    void bind(core::feed_machine& feed, protocol::request_text request, time_point deadline,
              detail::pending_ptr operation);
    void unbind(core::feed_machine& feed);

    void on_line(std::string_view line) override;
    void on_overlong(std::string_view head) override;
    void on_cut(std::string_view rest) override;
    void on_batch() override;
    void on_end() override;
    void on_lost(boost::system::error_code why) override;
    void on_room() override;

    void flush() override;
    [[nodiscard]] bool write() override;
    [[nodiscard]] bool asks_alone() override { return session_.asking().in_flight() <= 1; }
    [[nodiscard]] std::shared_ptr<core::turn_taker> share() override { return shared_from_this(); }

    std::string& output() override { return link_->output(); }
    [[nodiscard]] std::size_t datagram() const noexcept override { return link_->datagram(); }
    void wake() override;
    [[nodiscard]] bool is_behind() const override;
    void pause(bool stop) override;
    void finish() override;
    void close() override;

    [[nodiscard]] bool takes_updates() const override;
    void put_updates(std::string_view lines) override;

  private:
    struct stall_watch final : core::deadline {
        explicit stall_watch(connection& c) : owner(c) {}
        void on_deadline(time_point now) override { owner.on_stall(now); }
        connection& owner;
        std::uint64_t sent = 0;
    };

    bool hears(std::string_view text);
    void on_quiet() override { abandon("nothing came for a while"); }
    void on_stall(time_point now);
    void send_output();
    [[nodiscard]] bool may_serve_more();
    void follow_backlog();
    void end(std::string_view why);
    void lose_feeds(std::string_view why);

    node_run& node_;
    link_ptr link_;
    origin from_;
    core::session session_;
    stall_watch stall_;
    std::optional<core::datagram_output> datagrams_;
    std::optional<core::source_life> life_;
    std::vector<core::feed_machine*> feeds_;
    unsigned lines_ = 0;
    bool in_batch_ = false;
    bool usable_ = true;
    bool gone_ = false;
    mutable bool updates_wait_ = false;
    bool pause_for_queue_ = false;
    bool pause_for_backlog_ = false;
};

} // namespace cles::simulation
