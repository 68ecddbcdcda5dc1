// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/pending.hpp>

#include "core/deadlines.hpp"
#include "core/feed_machine.hpp"
#include "core/outbound.hpp"
#include "simulation/connection.hpp"

#include <cstdint>
#include <functional>
#include <list>
#include <memory>
#include <string>
#include <vector>

namespace cles::simulation {

class node_run;

/// How a request goes.
enum class carrier : std::uint8_t { stream, datagram };

/// The way from a node to another: the links that lead there, made when they are needed, and what waits for one. Does
/// what shell/route.hpp does; the two are to be kept alike.
class route {
  public:
    route(node_run& from, unsigned to, carrier by) : node_(from), to_(to), by_(by) {}
    route(const route&) = delete;
    route& operator=(const route&) = delete;

    struct request {
        cles::verb verb = verb::pull;
        std::string_view noun;
        std::string_view body;
        std::uint64_t id = 0;
        time_point deadline{};
        std::string_view adverbs{}; ///< further ones
    };
    void send(const request& r, detail::pending_ptr operation, core::outbound::progress_function progress);
    bool cancel(std::uint64_t id);
    /// `ready` gets the link, or null where none could be made.
    void connect(core::feed_machine& feed, std::function<void(const std::shared_ptr<connection>&)> ready);
    void forget(const core::feed_machine& feed);
    void drop(const connection& c);
    /// Nothing waits.
    [[nodiscard]] bool idle() const noexcept { return requests_.empty() && binders_.empty() && !dialling_; }

  private:
    struct waiting final : core::deadline {
        explicit waiting(route& r) : owner(r) {}
        void on_deadline(time_point now) override;

        route& owner;
        cles::verb verb = verb::pull;
        std::string noun;
        std::string body;
        std::string adverbs;
        std::uint64_t id = 0;
        time_point deadline{};
        detail::pending_ptr operation;
        core::outbound::progress_function progress;
    };
    struct binder {
        core::feed_machine* feed;
        std::function<void(const std::shared_ptr<connection>&)> ready;
    };

    [[nodiscard]] std::shared_ptr<connection> usable() const;
    [[nodiscard]] std::shared_ptr<connection> free_for(const core::feed_machine& feed) const;
    void dial();
    void on_dialled(boost::system::error_code code, link_ptr made);
    void serve_waiting(const std::shared_ptr<connection>& c);
    void fail_waiting(boost::system::error_code code);

    node_run& node_;
    unsigned to_;
    carrier by_;
    std::vector<std::shared_ptr<connection>> links_;
    std::list<std::unique_ptr<waiting>> requests_;
    std::list<binder> binders_;
    bool dialling_ = false;
};

} // namespace cles::simulation
