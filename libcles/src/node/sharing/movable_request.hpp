// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/identity.hpp>
#include <cles/limits.hpp>
#include <cles/task_info.hpp>

#include "port/request_origin.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace cles::core {

class reply_writer;

/// What is needed to forward a request later, besides its body. Each job that may move has one, and few do: so it
/// is one text, which is short for most.
class movable_request {
  public:
    struct parts {
        std::string_view path;    ///< of its noun
        std::string_view via;     ///< the nodes that have forwarded it
        request_origin by;        ///< in a secured fleet, whose it is
        std::string_view adverbs; ///< as forwarded; empty: it has none of its own
        std::size_t size = 0;     ///< of its line
    };

    explicit movable_request(const parts& of)
        : via_at_(static_cast<std::uint32_t>(of.path.size())),
          requester_at_(static_cast<std::uint32_t>(via_at_ + of.via.size())),
          forwarder_at_(static_cast<std::uint32_t>(requester_at_ + of.by.requester.size())),
          adverbs_at_(static_cast<std::uint32_t>(forwarder_at_ + of.by.forwarder.size())), size_(of.size) {
        text_.reserve(adverbs_at_ + of.adverbs.size());
        text_.append(of.path).append(of.via).append(of.by.requester).append(of.by.forwarder).append(of.adverbs);
    }

    [[nodiscard]] std::string_view path() const noexcept { return part(0, via_at_); }
    [[nodiscard]] std::string_view via() const noexcept { return part(via_at_, requester_at_); }
    [[nodiscard]] request_origin origin() const noexcept {
        return {.requester = part(requester_at_, forwarder_at_), .forwarder = part(forwarder_at_, adverbs_at_)};
    }
    [[nodiscard]] std::string_view adverbs() const noexcept { return part(adverbs_at_, text_.size()); }
    [[nodiscard]] std::size_t size() const noexcept { return size_; }

  private:
    [[nodiscard]] std::string_view part(std::size_t from, std::size_t to) const noexcept {
        return std::string_view{text_}.substr(from, to - from);
    }

    std::string text_;
    std::uint32_t via_at_;
    std::uint32_t requester_at_;
    std::uint32_t forwarder_at_;
    std::uint32_t adverbs_at_;
    std::size_t size_;
};

/// What a node that shares work does with requests. An interface, so that a program that does not share does not link
/// it.
class request_sharing {
  public:
    request_sharing() = default;
    request_sharing(const request_sharing&) = delete;
    request_sharing& operator=(const request_sharing&) = delete;

    /// What is needed to forward the request for that task; nothing if it is not moved to other nodes.
    [[nodiscard]] virtual std::optional<movable_request> movable(const protocol::request_line& r, const task_info& task,
                                                                 const identity& peer) = 0;
    /// Uses a slot of the grant on which the request for that task came. Returns why it cannot.
    [[nodiscard]] virtual std::optional<protocol::failure>
    use_grant(const protocol::request_line& r, const task_info& task, const identity& peer, time_point now) = 0;
    /// The adverb of a reply to that node with which it gets another slot; empty: it gets none.
    [[nodiscard]] virtual std::string grant_another(std::string_view to) = 0;
    /// Serves `PUSH self:cles/slots`.
    virtual void serve_slots(reply_writer& replies, const protocol::request_line& r, const identity& peer,
                             time_point now) = 0;

  protected:
    ~request_sharing() = default;
};

} // namespace cles::core
