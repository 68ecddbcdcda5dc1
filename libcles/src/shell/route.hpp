// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/line_link.hpp>
#include <cles/pending.hpp>

#include "core/deadlines.hpp"
#include "core/outbound.hpp"
#include "shell/connection.hpp"

#include <cstdint>
#include <functional>
#include <list>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {
class feed_machine;
} // namespace cles::core

namespace cles::shell {

/// The way to one URL: the links that lead there, made when they are needed, and what waits for one.
class route : public std::enable_shared_from_this<route> {
  public:
    route(std::shared_ptr<local_node> host, url where);
    /// To a node of which nobody has heard yet: holds what is to go there until `hand_over` or `fail`.
    route(std::shared_ptr<local_node> host, std::string_view node);

    struct request {
        cles::verb verb = verb::pull;
        std::string_view noun;
        std::string_view adverbs{}; ///< beside those that the link itself writes
        std::string_view body;
        std::uint64_t id = 0;
        bool urgent = false;
        time_point begun{};
        time_point deadline{};
    };
    /// With a link, or null and why there is none, in words too.
    using ready_function =
        std::function<void(const std::shared_ptr<connection>&, boost::system::error_code, std::string_view)>;
    /// Sends a request on a link that is there, or as soon as one has been made.
    void send(const request& r, detail::pending_ptr operation, core::outbound::progress_function progress);
    /// Withdraws a request that waits here for its link. False where there is none of that id.
    bool cancel(std::uint64_t id);
    /// Finds the feed a link on which its noun is not bound yet, and calls `ready`; not any more after `forget`.
    void connect(core::feed_machine& feed, ready_function ready);
    void forget(const core::feed_machine& feed);
    /// Sends what waits here by another route.
    void hand_over(route& way);
    /// Tells all that wait that there is no link.
    void fail(boost::system::error_code code, std::string_view message);
    /// A link has been lost or can no longer be used.
    void drop(const connection& c);
    /// Closes the links over which nothing goes on.
    void release();
    /// Gives up, and fails the requests that wait, none inside the call.
    void stop();

    [[nodiscard]] const std::string& address() const noexcept { return address_; }
    /// Nothing is lost with it.
    [[nodiscard]] bool idle() const noexcept {
        return links_.empty() && requests_.empty() && binders_.empty() && !give_up_;
    }

  private:
    struct waiting final : core::deadline {
        explicit waiting(route& r) : owner(r) {}
        void on_deadline(time_point now) override;
        /// The request, to be sent now; it views what is held here.
        [[nodiscard]] request asked(time_point now) const {
            return {.verb = verb,
                    .noun = noun,
                    .adverbs = adverbs,
                    .body = body,
                    .id = id,
                    .urgent = urgent,
                    .begun = now,
                    .deadline = deadline};
        }

        route& owner;
        cles::verb verb = verb::pull;
        std::string noun;
        std::string adverbs;
        std::string body;
        std::uint64_t id = 0;
        bool urgent = false;
        time_point deadline{};
        detail::pending_ptr operation;
        core::memory_reservation memory;
        core::outbound::progress_function progress;
    };
    struct binder {
        core::feed_machine* feed;
        ready_function ready;
    };

    [[nodiscard]] std::shared_ptr<connection> usable() const;
    [[nodiscard]] std::shared_ptr<connection> free_for(const core::feed_machine& feed) const;
    void dial();
    void on_dialled(boost::system::error_code code, link_ptr made);
    void serve_waiting(const std::shared_ptr<connection>& c);

    std::shared_ptr<local_node> host_;
    std::optional<url> where_; // nothing: not known yet
    std::string address_;
    std::vector<std::shared_ptr<connection>> links_;
    std::list<std::unique_ptr<waiting>> requests_;
    std::list<binder> binders_;
    std::function<void()> give_up_; // set while a link is being made
};

} // namespace cles::shell
