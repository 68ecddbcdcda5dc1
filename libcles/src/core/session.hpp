// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/identity.hpp>

#include "core/inbound.hpp"
#include "core/node.hpp"
#include "core/outbound.hpp"
#include "core/outlet.hpp"
#include "core/subscription.hpp"

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

namespace cles::core {

/// What happens on one link, whatever it runs over: requests and replies cross it in both directions. Lines and time go
/// in; what is to be sent comes out through the outlet.
class session {
  public:
    session(std::shared_ptr<node> host, outlet& out, binder& updates, const identity& peer);

    void on_line(std::string_view line, time_point now);
    void on_overlong(std::string_view head, time_point now);
    /// The peer has ended in the middle of a line.
    void on_cut(std::string_view rest, time_point now);
    /// The peer sends no more.
    void on_end(time_point now);
    /// The link is gone, for this reason.
    void on_lost(std::string_view why);

    /// Nothing is kept for the peer, and nothing is expected of it.
    [[nodiscard]] bool at_rest() const noexcept {
        return inbound_.at_rest() && outbound_.in_flight() == 0 && subscriptions_.empty();
    }
    /// Answers a line with `busy` and nothing else.
    void turn_away(std::string_view line);
    /// Tells the peer that there is no room for its link, in answer to nothing.
    void say_busy();
    [[nodiscard]] inbound& serving() noexcept { return inbound_; }
    [[nodiscard]] outbound& asking() noexcept { return outbound_; }
    [[nodiscard]] subscriptions& bound() noexcept { return subscriptions_; }
    /// This node made the link: the other one may refuse it as a whole, with a `busy` that answers nothing.
    void may_be_refused() noexcept { refusal_ = refusal::possible; }

  private:
    [[nodiscard]] bool is_datagram() const noexcept { return out_.datagram() != 0; }
    void refuse(std::string_view text, const char* why, time_point now);
    void on_reply(std::string_view line);
    void note_refusal(std::string_view line);
    void lose_requests(std::string_view why);
    void on_update(const subscriptions::match& found);

    std::shared_ptr<node> node_;
    outlet& out_;
    const identity& peer_;
    inbound inbound_;
    outbound outbound_;
    subscriptions subscriptions_;
    enum class refusal : std::uint8_t { ruled_out, possible, told } refusal_ = refusal::ruled_out;
    std::string refusal_text_; // the whole of what was told
    bool closed_ = false;
};

} // namespace cles::core
