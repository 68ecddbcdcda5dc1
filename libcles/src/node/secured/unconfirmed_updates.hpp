// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/identity.hpp>

#include "node/base/deadlines.hpp"
#include "node/base/peer_reply.hpp"
#include "node/node_state.hpp"
#include "node/secured/confirmed_epochs.hpp"
#include "node/session/outbound.hpp"
#include "protocol/request_line.hpp"

#include <cstddef>
#include <cstdint>
#include <functional>
#include <list>
#include <memory>
#include <set>
#include <string>
#include <string_view>
#include <utility>

namespace cles::core {

/// The updates on one link whose epochs their publishers have not confirmed yet. Asks for the epoch on that link, and
/// delivers what is confirmed; the rest is dropped, counted and logged.
class unconfirmed_updates final : public std::enable_shared_from_this<unconfirmed_updates>, private deadline {
  public:
    static constexpr std::size_t max_lines = 64;
    static constexpr std::size_t max_bytes = 256 * 1024;

    using deliver_function = std::function<void(std::string_view line)>;

    /// What it refers to must outlive this; `deliver` is not called from inside `hold`.
    unconfirmed_updates(node_state& host, confirmed_epochs& confirmed, outbound& asking, const identity& peer,
                        deliver_function deliver)
        : node_(host), confirmed_(confirmed), outbound_(asking), peer_(peer), deliver_(std::move(deliver)) {}
    unconfirmed_updates(const unconfirmed_updates&) = delete;
    unconfirmed_updates& operator=(const unconfirmed_updates&) = delete;
    ~unconfirmed_updates() = default;

    /// Holds the update until its publisher has confirmed the epoch. Beyond the limits, it is dropped.
    void hold(const protocol::request_line& update, time_point now);
    /// Asks the publisher for its epoch now. `then` is called with its answer, or by `due` with the failure.
    void ask(const std::string& publisher, time_point due, time_point now, peer_reply::function then);
    [[nodiscard]] std::size_t size() const noexcept { return held_.size(); }

  private:
    struct held_update {
        std::string publisher;
        std::uint32_t epoch = 0;
        std::string line;
        bool asked = false; // it arrived before the question was sent
    };

    void on_deadline(time_point now) override;
    void ask_for_held(const std::string& publisher, time_point now);
    /// Returns false if that publisher has not signed the answer.
    [[nodiscard]] bool take_answer(const std::string& publisher, std::string_view challenge, std::string_view json);
    void on_answered_for_held(const std::string& publisher, std::string_view failure);
    void drop(std::string_view why);
    /// Returns false if the link ended meanwhile, and with it what this refers to.
    [[nodiscard]] bool deliver_confirmed();

    node_state& node_;
    confirmed_epochs& confirmed_;
    outbound& outbound_;
    const identity& peer_;
    deliver_function deliver_;
    std::list<held_update> held_;
    std::size_t bytes_ = 0;
    std::set<std::string, std::less<>> asked_; // publishers whose replies are expected
};

} // namespace cles::core
