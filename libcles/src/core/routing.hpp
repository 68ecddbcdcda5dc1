// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "core/catalogue.hpp"
#include "core/chooser.hpp"
#include "core/node.hpp"
#include "core/onward.hpp"
#include "core/relays.hpp"
#include "core/router.hpp"

#include <cstdint>
#include <deque>
#include <functional>
#include <list>
#include <memory>
#include <string>
#include <vector>

namespace cles::core {

class all_binding;

/// Acts for a node's clients on requests that are not for it alone: passes on what names another node, chooses for
/// `any`, asks all for `all` (docs/protocol.md, "Routing").
class routing final : public router, private catalogue::listener, public std::enable_shared_from_this<routing> {
  public:
    /// `wake` is called when there is something to do in a turn: updates to `drain`, or what is ready to begin.
    routing(std::shared_ptr<node> host, onward& out, std::uint32_t seed, std::function<void()> wake);
    ~routing();

    /// `any` and `all` wait: who is there is still being asked.
    void hold() noexcept { held_ = true; }
    /// The nodes that are to be found have been.
    void release(time_point now);
    /// Asks nobody any more.
    void stop();
    [[nodiscard]] bool stopped() const noexcept { return stopped_; }

    bool route(const protocol::request_line& request, const identity& peer, time_point due, time_point now,
               call_opener& from) override;
    void go_on(const protocol::request_line& request, const identity& peer, const protocol::failure& why,
               time_point due, time_point now, call_opener& from) override;
    void bind(const protocol::request_line& request, relayed_bindings& place, time_point due, time_point now,
              call_opener& from) override;
    std::shared_ptr<relays> relayed() override { return relays_; }
    /// Begins what has become ready. Runs handlers of this node's.
    void begin_ready(time_point now);
    /// Passes updates on that have come since the last time.
    void drain(time_point now) { relays_->drain(now); }

    /// A request that may have to wait until somebody is known who offers it.
    ///
    /// Where it is begun, handlers of this node are, and they may do anything. So it is begun where its line is read,
    /// or in a turn: never where something has become known, where another node has answered, or at a deadline, since
    /// the library goes through all of these in loops.
    class errand {
      public:
        errand() = default;
        errand(const errand&) = delete;
        errand& operator=(const errand&) = delete;
        virtual ~errand() = default;
        /// Begins it or goes on with it. False where it still has to wait.
        virtual bool begin(time_point now) = 0;
        /// Nobody waits for it any more.
        [[nodiscard]] virtual bool over() const = 0;
    };

    // For the errands.
    [[nodiscard]] node& host() noexcept { return *node_; }
    [[nodiscard]] const std::shared_ptr<node>& shared_host() const noexcept { return node_; }
    [[nodiscard]] onward& out() noexcept { return out_; }
    [[nodiscard]] chooser::chosen choose(const protocol::request_line& r, const std::vector<std::string>& asked,
                                         time_point now) {
        return chooser_.choose(r, asked, now);
    }
    void avoid_here(time_point until) noexcept { chooser_.avoid_here(until); }
    [[nodiscard]] known_node* find(std::string_view name) noexcept { return catalogue_.find(name); }
    [[nodiscard]] const std::vector<catalogue::offer>& offers(verb v, std::string_view task) const {
        return catalogue_.offers(v, task);
    }
    /// Has it begun in the next turn, and keeps it until then.
    void begin_soon(std::shared_ptr<errand> e);
    [[nodiscard]] bool is_held() const noexcept { return held_; }
    [[nodiscard]] bool expects_more() const noexcept { return held_ || catalogue_.expects_more(); }
    [[nodiscard]] protocol::failure nobody_offers(const protocol::request_line& r) const;

  private:
    void on_offers(time_point now) override;
    void begin(std::shared_ptr<errand> e, time_point now);
    bool runs_in_line(const protocol::request_line& r) const;

    std::shared_ptr<node> node_;
    onward& out_;
    catalogue catalogue_;
    chooser chooser_;
    std::shared_ptr<relays> relays_;
    std::list<std::shared_ptr<errand>> waiting_;
    std::deque<std::shared_ptr<errand>> ready_; // for the next turn
    std::function<void()> wake_;
    std::vector<std::weak_ptr<all_binding>> all_;
    bool held_ = false;
    bool stopped_ = false;
};

} // namespace cles::core
