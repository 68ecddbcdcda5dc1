// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/pending.hpp>

#include "core/directory.hpp"
#include "shell/connection.hpp"
#include "shell/route.hpp"

#include <boost/system/error_code.hpp>

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {
class feed_machine;
} // namespace cles::core

namespace cles::shell {

class local_node;

/// The ways from a service to others, and which of them leads to a node: first what was configured, then services on
/// the same context, then what the nodes themselves announce.
class routes {
  public:
    explicit routes(local_node& host) noexcept : host_(host) {}

    /// Says where a node is; an empty URL forgets it. \throws cles::error
    void set_peer(std::string_view name, std::string_view where);
    /// The route for a target, or null with the reason in `code` and `why`. It may be one that only waits, for a node
    /// of which nobody has heard yet. What is urgent has links of its own.
    route* to(std::string_view target, std::string_view at, bool urgent, boost::system::error_code& code,
              std::string& why);
    /// It has become known, or known no more, where the node is.
    void on_whereabouts(std::string_view node);
    /// No more names are heard that some wait for.
    void on_round_over();

    /// Withdraws a request that waits for its link. False where there is none of that id.
    bool cancel(std::uint64_t id);
    /// A feed no longer waits for a link.
    void forget(const core::feed_machine& feed);
    /// A link has been lost or can no longer be used.
    void drop(const connection& c);
    /// Nobody is asked at that URL for a while: a link over which nothing goes on is closed.
    void release(std::string_view url);
    /// Gives up, and fails the requests that wait.
    void stop();

  private:
    [[nodiscard]] std::string address_of(std::string_view target) const;
    route* find(std::string_view target, std::string_view at, bool urgent, boost::system::error_code& code,
                std::string& why);

    local_node& host_;
    core::directory directory_;
    std::map<std::string, std::shared_ptr<route>, std::less<>> routes_; // by URL, and whether urgent
    std::string recent_target_;                                         // most requests go where the one before went
    route* recent_ = nullptr;
};

} // namespace cles::shell
