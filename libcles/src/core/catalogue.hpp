// SPDX-License-Identifier: BSL-1.0
#pragma once

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
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

/// Another node, and what it offers.
struct known_node : candidate {
    std::string name;
    bool live = true;      ///< heard of lately
    bool reachable = true; ///< at an address that can be used from here
    std::uint32_t run = 0; ///< its epoch
    std::string digest;    ///< of its tasks, as announced

    enum class tasks_are : std::uint8_t { unknown, asked, known };
    tasks_are state = tasks_are::unknown;
    bool tried = false; ///< it has been asked, and did not say
    std::shared_ptr<const task_list> tasks;
};

/// Who offers what, of the other nodes: follows their presence, and has them say what they offer when the digest that
/// they announce is another one. Nodes with the same digest offer the same, and only one of them is asked.
class catalogue final : private presence::observer, private deadline {
  public:
    class listener {
      public:
        listener() = default;
        listener(const listener&) = delete;
        listener& operator=(const listener&) = delete;
        /// Others may be offered or missing from now on, or all that were asked have answered.
        virtual void on_offers(time_point now) = 0;

      protected:
        ~listener() = default;
    };
    struct offer {
        known_node* by = nullptr;
        bool idempotent = false;
    };

    static constexpr std::chrono::milliseconds answer_within{1'000};
    static constexpr std::chrono::milliseconds ask_again_after{2'000};
    static constexpr std::size_t asked_at_once = 16;

    catalogue(node& host, onward& out, listener& owner);
    ~catalogue();
    /// Asks nobody any more.
    void stop() noexcept;

    /// Valid until the next change. For the task `cles`: all nodes.
    [[nodiscard]] const std::vector<offer>& offers(verb v, std::string_view task) const;
    /// Some have never been heard of what they offer, and may be any moment.
    [[nodiscard]] bool expects_more() const noexcept;
    /// Null where it is not known (any more).
    [[nodiscard]] known_node* find(std::string_view name) noexcept;
    [[nodiscard]] std::size_t size() const noexcept { return nodes_.size(); }

  private:
    class asking; // one node for its tasks

    void on_heard(std::string_view name) override;
    void on_deadline(time_point now) override;
    void ask(time_point now);
    void on_told(const std::string& name, std::uint32_t run, const std::string& digest, std::string_view said);
    void on_silent(const std::string& name);
    void set_tasks(known_node& of, std::shared_ptr<const task_list> tasks);
    void forget_offers(const known_node& of);
    void offer_all(const known_node& of);
    [[nodiscard]] std::shared_ptr<const task_list> tasks_of_another(const known_node& like) const;

    node& node_;
    onward& out_;
    listener& owner_;
    std::map<std::string, std::unique_ptr<known_node>, std::less<>> nodes_;
    using by_verb = std::array<std::vector<offer>, verb_count>;
    text_map<by_verb> offers_;
    std::vector<offer> everyone_;
    std::size_t asked_ = 0;
    std::shared_ptr<catalogue*> alive_; // for those whose answer comes when it is gone
};

} // namespace cles::core
