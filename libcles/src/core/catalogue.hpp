// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "core/ask_queue.hpp"
#include "core/choice.hpp"
#include "core/deadlines.hpp"
#include "core/leg.hpp"
#include "core/node.hpp"
#include "core/onward.hpp"
#include "core/task_list.hpp"
#include "core/text_map.hpp"

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::core {

/// Another node, and what it offers.
struct known_node : candidate, inquiry {
    std::string name;
    bool live = true;      ///< heard of lately
    bool reachable = true; ///< at an address that can be used from here
    std::uint32_t run = 0; ///< its epoch
    std::string digest;    ///< of its tasks, as announced

    enum class tasks_are : std::uint8_t { unknown, asked, known };
    tasks_are state = tasks_are::unknown;
    std::uint64_t ticket = 0;                 ///< by which it was asked last
    std::optional<time_point> expected_until; ///< it may say any moment until then
    std::shared_ptr<const task_list> tasks;
};

/// Who offers what, of the other nodes: follows their presence, and has them say what they offer when the digest that
/// they announce is another one. Nodes with the same digest offer the same, and only one of them is asked. What an
/// announcement or a failed ask costs does not depend on how many nodes are known.
class catalogue final : private presence::observer, private deadline {
  public:
    class listener {
      public:
        listener() = default;
        listener(const listener&) = delete;
        listener& operator=(const listener&) = delete;
        /// Others may be offered or missing from now on, or nobody is expected to say anything more.
        virtual void on_offers(time_point now) = 0;

      protected:
        ~listener() = default;
    };
    struct offer {
        known_node* by = nullptr;
        bool idempotent = false;
    };

    static constexpr std::chrono::milliseconds answer_within{1'000};

    catalogue(node& host, onward& out, listener& owner);
    ~catalogue();
    /// Asks nobody any more.
    void stop() noexcept;

    /// Valid until the next change. For the task `cles`: all nodes.
    [[nodiscard]] const std::vector<offer>& offers(verb v, std::string_view task) const;
    /// Some that have been heard of within the last second have not said what they offer, and may any moment.
    [[nodiscard]] bool expects_more() const noexcept { return !expected_.empty(); }
    /// Null where it is not known (any more).
    [[nodiscard]] known_node* find(std::string_view name) noexcept;
    [[nodiscard]] std::size_t size() const noexcept { return nodes_.size(); }
    /// The measure of what asking costs.
    [[nodiscard]] std::uint64_t steps() const noexcept { return asks_.steps(); }

  private:
    class asking; // one node for its tasks
    /// The nodes of one digest.
    struct kind {
        std::map<std::string_view, known_node*> nodes{}; // by name
        std::shared_ptr<const task_list> tasks{};        // null: not known
        const known_node* asked = nullptr;               // the others wait for what it says
        std::map<std::string_view, known_node*> waiting{};
    };

    void on_heard(std::string_view name) override;
    void on_deadline(time_point now) override;
    void begin_anew(known_node& of, std::string_view digest, std::string_view where, time_point now);
    void leave_kind(known_node& n);
    void forget(known_node& n, time_point now);
    void expect(known_node& n, std::optional<time_point> until);
    void wait_for_turn(known_node& n);
    void give_up(known_node& n);
    void ask(time_point now);
    void on_told(const std::string& name, std::uint64_t ticket, std::string_view said);
    void on_silent(const std::string& name, std::uint64_t ticket, bool unreachable);
    void wake_next(kind& of);
    void follow();
    void set_tasks(known_node& of, std::shared_ptr<const task_list> tasks);
    void forget_offers(const known_node& of);
    void offer_all(const known_node& of);
    [[nodiscard]] kind* kind_of(const known_node& n) noexcept;
    [[nodiscard]] known_node* asked_by(const std::string& name, std::uint64_t ticket) noexcept;

    node& node_;
    onward& out_;
    listener& owner_;
    std::map<std::string, std::unique_ptr<known_node>, std::less<>> nodes_;
    using by_verb = std::array<std::vector<offer>, verb_count>;
    text_map<by_verb> offers_;
    std::vector<offer> everyone_;
    std::map<std::string, kind, std::less<>> kinds_; // by digest
    ask_queue asks_;
    std::set<std::pair<time_point, std::string_view>> expected_; // until when, and the name
    std::uint64_t last_ticket_ = 0;
    std::shared_ptr<catalogue*> alive_; // for those whose answer comes when it is gone
};

} // namespace cles::core
