// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/line_link.hpp>

#include "core/link_admission.hpp"
#include "shell/connection.hpp"

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <vector>

namespace cles::shell {

class local_node;

/// All connections of a service: lets them in as far as there is room, owns them, and lets them go.
///
/// Sources of datagrams are counted apart from links: they can be forged, and must not take the room of those that
/// cannot.
class connections {
  public:
    explicit connections(local_node& host) noexcept : host_(host) {}
    /// \pre the local node has its state
    void start();

    /// A link that came in; those from other processes are counted against the limit.
    void on_accepted(link_ptr arrived, bool counted);
    std::shared_ptr<connection> adopt(link_ptr made, connection::origin from);
    /// Nothing that others ask for is begun any more, on those that are open and those to come.
    void begin_nothing();
    /// False where it was none of them (any more).
    bool forget(connection& c, std::uint64_t received, std::uint64_t sent);
    /// Withdraws a request that waits for its reply. False where there is none of that id.
    bool cancel(std::uint64_t id);
    [[nodiscard]] std::vector<std::shared_ptr<connection>> all() const;
    /// Finishes a link that nobody needs any more, and keeps it until it has closed.
    void see_off(link_ptr parting);
    void seen_off(const link& parting);
    /// Closes those that are being seen off.
    void stop();

  private:
    class refused;

    [[nodiscard]] bool has_room(const link& arrived);
    void turn_away(link_ptr arrived);
    static void begin_nothing(connection& c);
    void drop_sources_at_rest();

    local_node& host_;
    std::map<std::uint64_t, std::shared_ptr<connection>> open_; // by number, so that their order is always the same
    std::uint64_t last_number_ = 0;
    std::map<const link*, link_ptr> parting_;
    std::optional<core::link_admission> admission_;
    std::size_t sources_ = 0;
};

} // namespace cles::shell
