// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/json_writer.hpp>
#include <cles/peer.hpp>

#include "core/announcement.hpp"
#include "core/deadlines.hpp"
#include "core/group_source.hpp"

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

/// Who else is there, from what they announce (docs/protocol.md, "Presence").
///
/// A name belongs to the run of a node that was heard under it first, for as long as that run is live: only it, from
/// where it announces, moves the name or leaves. Another run that announces the same name waits. When the first one
/// falls silent it was a restart, and the name is the other's; when both are heard in turn it is a clash, which is
/// reported, and the second is not asked.
class presence final : private deadline {
  public:
    enum class change : std::uint8_t {
        appeared,
        moved,    ///< the same name at another place, of this run or the next
        silent,   ///< it has become suspect
        returned, ///< it is heard again
        left,     ///< with a word
        gone,     ///< without one
        clash,    ///< a second live node of that name
    };
    /// Who is told of changes, after they have been made. `where`: the URL at which it is asked now, or of `clash`
    /// where the second one was heard from; it may be empty.
    class watcher {
      public:
        watcher() = default;
        watcher(const watcher&) = delete;
        watcher& operator=(const watcher&) = delete;
        virtual void on_peer(std::string_view node, change what, std::string_view where) = 0;

      protected:
        ~watcher() = default;
    };

    enum class verdict : std::uint8_t {
        taken,
        own,     ///< this node's own word, back from the group
        old,     ///< overtaken, repeated, or from a run that has left
        refused, ///< as many are known as may be
    };

    presence(std::string own_name, std::uint32_t own_epoch, deadline_queue& deadlines, std::size_t most)
        : own_name_(std::move(own_name)), own_epoch_(own_epoch), deadlines_(deadlines), most_(most) {}
    void watch(watcher* who) noexcept { watcher_ = who; }

    verdict hear(const announcement& said, std::uint32_t epoch, std::uint64_t seq, const group_source& from,
                 time_point now);

    /// Where the node of that name is to be asked; nothing where it is not known, empty where no address of it can be
    /// used from here. Valid until the next change.
    [[nodiscard]] std::optional<std::string_view> find(std::string_view node) const noexcept;
    /// How many others there are.
    [[nodiscard]] std::size_t size() const noexcept { return peers_.size(); }
    /// All of them by name, those that clash behind those whose name it is.
    [[nodiscard]] std::vector<peer> list(time_point now) const;

  private:
    /// A node from one start to the next.
    struct run {
        announcement said;
        std::uint32_t epoch = 0;
        std::uint64_t seq = 0;
        group_source from;
        time_point heard{};
        std::vector<std::string> endpoints; // as they can be used here

        [[nodiscard]] bool is(std::uint32_t e, const group_source& f) const noexcept { return epoch == e && from == f; }
        [[nodiscard]] std::string_view where() const noexcept {
            return endpoints.empty() ? std::string_view{} : std::string_view{endpoints.front()};
        }
        [[nodiscard]] time_point silent_at() const noexcept { return heard + said.interval * 7 / 2; }
        [[nodiscard]] time_point gone_at() const noexcept { return heard + said.interval * 15; }
    };
    /// Another run under a name that is taken.
    struct rival {
        run of;
        bool first_heard_since = false; // the name's owner, after this one
        bool clashes = false;
    };
    struct entry {
        run owner;
        bool suspect = false;
        std::unique_ptr<rival> second;
    };
    using entries = std::map<std::string, entry, std::less<>>;
    struct farewell {
        std::uint32_t epoch = 0;
        std::uint64_t seq = 0;
    };

    static void take(run& into, const announcement& said, std::uint64_t seq, time_point now);
    static run first_words(const announcement& said, std::uint32_t epoch, std::uint64_t seq, const group_source& from,
                           time_point now);
    verdict hear_owner(entries::iterator at, const announcement& said, std::uint64_t seq, time_point now);
    verdict hear_rival(std::unique_ptr<rival>& second, run said);
    void end(entries::iterator at, change how, time_point now);
    void succeed(entries::iterator at, run next);
    [[nodiscard]] bool has_left(std::uint32_t epoch, std::uint64_t seq) const noexcept;
    void remember(const run& left) noexcept;
    void on_deadline(time_point now) override;
    void follow(time_point due);
    void tell(std::string_view node, change what, std::string_view where) const;

    const std::string own_name_;
    const std::uint32_t own_epoch_;
    deadline_queue& deadlines_;
    const std::size_t most_;
    watcher* watcher_ = nullptr;
    entries peers_;
    std::unique_ptr<rival> namesake_; // of this node itself
    std::array<farewell, 16> farewells_{};
    std::size_t next_farewell_ = 0;
};

/// Writes the reply to `PULL self:cles/peers`.
void write_peers(json_writer& w, const presence& others, time_point now);

} // namespace cles::core
