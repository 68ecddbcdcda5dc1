// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "core/feed_machine.hpp"
#include "shell/connection.hpp"

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace cles::shell {

class local_node;

/// What a feed is bound to.
struct feed_terms {
    std::string noun;
    std::string at;
    std::chrono::milliseconds deadline{};
    std::uint32_t every_ms = 0;
    std::uint32_t keep = 0;
    std::string adverbs{}; ///< further ones, as they stand on the wire
    bool marked = false;   ///< asks which update the last value is, where the publisher can say
};

/// The feeds of a service and the links that they are on: finds each a link, sends its BIND, and unbinds it.
class feed_links final : public core::feed_host {
  public:
    explicit feed_links(local_node& host) noexcept : host_(host) {}

    void enter(core::feed_machine& feed, std::weak_ptr<void> handle, feed_terms terms);
    void leave(core::feed_machine& feed);
    void bind(core::feed_machine& feed) override;
    void unbind(core::feed_machine& feed) override;
    void detach(core::feed_machine& feed) override;
    void renew(core::feed_machine& feed, time_point until) override;
    /// Another run has that name: feeds that wait to bind there do so at once. `replaced`: feeds that are still bound
    /// at the run before are bound anew.
    void on_new_run(std::string_view node, bool replaced);
    /// Closes all.
    void stop();

  private:
    struct entry {
        std::weak_ptr<void> handle;
        feed_terms terms;
        std::weak_ptr<connection> on;
        std::string at{};                // the URL where it was asked for last
        std::uint64_t asking = 0;        // the id of its last BIND by datagram
        std::optional<time_point> due{}; // until when a BIND is to be answered that waits for the node's features
        std::uint64_t number = 0;        // in the order in which they were entered
    };

    class features_reply;

    void send_bind(core::feed_machine& feed, const std::shared_ptr<connection>& c);
    void ask_for_features(core::feed_machine& feed, const std::shared_ptr<connection>& c);
    [[nodiscard]] protocol::request_text bind_text(entry& e, const connection& c);
    void refuse_later(core::feed_machine& feed, boost::system::error_code code, const std::string& why);

    /// As they were entered, so that the order does not depend on addresses.
    [[nodiscard]] std::vector<core::feed_machine*> in_order() const;

    local_node& host_;
    std::map<core::feed_machine*, entry> feeds_;
    std::uint64_t last_number_ = 0;
};

} // namespace cles::shell
