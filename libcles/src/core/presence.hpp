// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/peer.hpp>

#include "core/announcement.hpp"
#include "core/deadlines.hpp"
#include "core/ended_runs.hpp"
#include "core/known_run.hpp"
#include "core/name_check.hpp"
#include "core/news_item.hpp"
#include "core/peer_report.hpp"
#include "core/run_index.hpp"
#include "core/teller.hpp"
#include "port/group_source.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <list>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::core {

/// Who else is there, from what they announce, and from what others tell of them (docs/protocol.md, "Membership" and
/// "Gossip").
///
/// A name belongs to the run of a node that was heard under it first, for as long as that run is live: only it, from
/// where it announces, moves the name or leaves. Another run that announces the same name waits. When the first one
/// falls silent it was a restart, and the name is the other's; when both are heard in turn it is a clash, which is
/// reported, and the second is not asked. So as not to wait for that, the owner is asked whether it is still there,
/// where somebody can do so: if it is not, the name moves at once; if it is, so is the other, and both answer, it is a
/// clash.
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
        taken,    ///< this node's own name is that of another live node, which was there first
    };
    /// Who is told of changes, after they have been made. `where`: the URL at which it is asked now, or was
    /// until now, or of `clash` where the second one was heard from; it may be empty.
    class watcher {
      public:
        watcher() = default;
        watcher(const watcher&) = delete;
        watcher& operator=(const watcher&) = delete;
        virtual void on_peer(std::string_view node, change what, std::string_view where) = 0;

      protected:
        ~watcher() = default;
    };

    /// Who is told of whatever is heard of a node, after it has been taken, and when it is forgotten.
    class observer {
      public:
        observer() = default;
        observer(const observer&) = delete;
        observer& operator=(const observer&) = delete;
        virtual void on_heard(std::string_view node) = 0;

      protected:
        ~observer() = default;
    };

    /// Asks a run of a node whether it is there: `PULL self:cles` at that URL, for `probe_limit` at most. What came of
    /// it is told by `on_probed`, never from inside the call.
    class prober {
      public:
        prober() = default;
        prober(const prober&) = delete;
        prober& operator=(const prober&) = delete;
        virtual void probe(std::uint64_t ticket, std::string_view url) = 0;

      protected:
        ~prober() = default;
    };
    static constexpr std::chrono::milliseconds probe_limit{500};
    static constexpr std::chrono::milliseconds together{1'000}; ///< two that start within it, neither was there first
    static constexpr std::chrono::milliseconds per_probe{50};   ///< one in so long, in the long run
    static constexpr std::chrono::milliseconds probe_burst{1'600};

    enum class verdict : std::uint8_t {
        taken,
        own,     ///< this node's own word, back from the group
        old,     ///< overtaken, repeated, or from a run that has left
        again,   ///< taken already, of a run that says the same by several interfaces
        refused, ///< as many are known as may be
        unknown, ///< of a run that has not been described
        foreign, ///< of another pool
    };
    /// A node, as a node that asks it needs to know it. Views are valid until the next change.
    struct known {
        std::string_view node;
        std::string_view where; ///< empty: at no address that can be used from here
        std::uint32_t epoch = 0;
        bool suspect = false;
        std::string_view tasks; ///< a digest of what it offers
        node_load load;
    };

    presence(std::string own_name, std::uint32_t own_epoch, deadline_queue& deadlines, std::size_t most)
        : own_name_(std::move(own_name)), own_epoch_(own_epoch), deadlines_(deadlines), most_(most), ended_(most) {}
    void watch(watcher* who) noexcept { watcher_ = who; }
    void observe(observer* who) noexcept { observer_ = who; }
    void probe_by(prober* who) noexcept { prober_ = who; }
    /// This node itself has begun, and belongs to that pool. What is said by or of nodes of others counts for nothing.
    void begin(std::string_view pool, time_point now) {
        own_pool_ = pool;
        begun_ = now;
    }
    [[nodiscard]] const std::string& pool() const noexcept { return own_pool_; }

    /// An announcement by multicast.
    verdict hear(const announcement& said, std::uint32_t epoch, std::uint64_t seq, const group_source& from,
                 time_point now);
    /// What another node tells. `asked`: when it was asked, since ages count from then.
    verdict be_told(const peer_report& report, const teller& by, time_point asked, time_point now);
    verdict be_told(const peer_beat& beat, time_point asked, time_point now);
    /// This node announces itself: it is to be told to others from then on.
    void speak(const announcement& own, std::uint64_t seq, time_point now);
    /// This node says farewell: from then on it is told as one that has left.
    void leave(time_point now);
    /// This node as it announced itself; null where it has not.
    [[nodiscard]] const known_run* own() const noexcept { return own_ ? &*own_ : nullptr; }
    /// What came of a probe.
    void on_probed(std::uint64_t ticket, const probe_outcome& found, time_point now);
    /// Where the second live node of that name is, if both have answered; nothing where there is one alone, or none.
    [[nodiscard]] std::optional<std::string_view> second_of(std::string_view node) const noexcept;
    /// This node was stopped, and could hear nobody: silence counts from now on.
    void excuse(time_point now) noexcept { excused_ = now; }

    /// Where the node of that name is to be asked; nothing where it is not known, empty where no address of it can be
    /// used from here. Valid until the next change.
    [[nodiscard]] std::optional<std::string_view> find(std::string_view node) const noexcept;
    /// How many others there are.
    [[nodiscard]] std::size_t size() const noexcept { return peers_.size(); }
    /// And how many there may be.
    [[nodiscard]] std::size_t most() const noexcept { return most_; }
    /// All of them by name, those that clash behind those whose name it is.
    [[nodiscard]] std::vector<peer> list(time_point now) const;

    /// From where in the group that name is announced; nothing where it was not heard there.
    [[nodiscard]] std::optional<group_source> source_of(std::string_view node) const noexcept;
    /// The run whose name it is; null where it was not heard in the group. Valid until the next change.
    [[nodiscard]] const known_run* announced(std::string_view node) const noexcept;
    /// What is known of it; nothing where it is not known.
    [[nodiscard]] std::optional<known> look(std::string_view node) const;
    /// The node whose name follows, behind the last the first; nothing where nobody is known.
    [[nodiscard]] std::optional<known> after(std::string_view node) const;
    /// By its index among all, from 0 on and less than `size`.
    [[nodiscard]] known at(std::size_t index) const;

    /// Calls it with each one, by name.
    template <class F>
    void each(F&& what) const {
        for (const auto& one : peers_) {
            what(known_of(one));
        }
    }

    /// What there is to tell that is newer than that, in order.
    [[nodiscard]] std::vector<news_item> news_since(std::uint64_t news, time_point now) const;
    /// All about a run; nothing where it is not known, or is told of in full anyway.
    [[nodiscard]] std::optional<news_item> description_of(std::uint32_t epoch) const;
    /// The number of the newest.
    [[nodiscard]] std::uint64_t latest_news() const noexcept { return news_; }

  private:
    /// Another run under a name that is taken.
    struct rival {
        known_run of;
        time_point first{};
        bool first_heard_since = false; // the name's owner, after this one
        bool clashes = false;
        name_check check{};
    };
    struct entry;
    using named_entry = std::pair<const std::string, entry>;
    struct entry {
        known_run owner;
        bool suspect = false;
        std::unique_ptr<rival> second;
        std::list<named_entry*>::iterator in_news{};
        time_point since{}; // the owner is known
    };
    using entries = std::map<std::string, entry, std::less<>>;

    static known known_of(const entries::value_type& one) noexcept {
        const auto& [name, e] = one;
        return {name, e.owner.where(), e.owner.epoch, e.suspect, e.owner.said.tasks, e.owner.said.load};
    }

    [[nodiscard]] std::chrono::milliseconds interval_of(const announcement& said, const group_source& from) const;
    /// Told, and too long ago to make anybody known.
    [[nodiscard]] bool is_stale(const word& w, time_point now) const;
    [[nodiscard]] time_point silent_at(const known_run& r) const;
    [[nodiscard]] time_point gone_at(const known_run& r) const;
    known_run first_words(const word& w);
    verdict take_word(const word& w, time_point now);
    verdict take_owners_word(entries::iterator at, const word& w, time_point now);
    verdict take_namesakes_word(const word& w, time_point now);
    verdict take_rivals_word(std::unique_ptr<rival>& second, const word& w, time_point now);
    verdict take_farewell(const word& w, time_point now);
    [[nodiscard]] bool may_probe(time_point now) noexcept;
    void check_owner(const std::string& name, time_point now);
    void check_namesake(time_point now);
    void probe(name_check& check, name_check::stage of, std::string name, std::string_view where, time_point now);
    void on_owner_probed(entries::iterator at, const probe_outcome& found, time_point now);
    void on_rival_probed(entries::iterator at, const probe_outcome& found, time_point now);
    void on_namesake_probed(const probe_outcome& found, time_point now);
    void confirm_clash(rival& second);
    void heard_again(named_entry& one, bool moved, bool told, time_point now);
    void end(entries::iterator at, change how, time_point now);
    void succeed(entries::iterator at, known_run next);
    void remember(const std::string& node, const known_run& over, bool farewell, time_point now);
    void drop_second(entries::iterator at);
    /// There is news of it: it goes behind all others.
    void freshen(named_entry& one) { by_news_.splice(by_news_.end(), by_news_, one.second.in_news); }
    void on_deadline(time_point now) override;
    void follow(time_point due);
    void tell(std::string_view node, change what, std::string_view where) const;
    void say_heard(std::string_view node) const;

    const std::string own_name_;
    const std::uint32_t own_epoch_;
    std::string own_pool_;
    deadline_queue& deadlines_;
    const std::size_t most_;
    watcher* watcher_ = nullptr;
    observer* observer_ = nullptr;
    prober* prober_ = nullptr;
    std::map<std::uint64_t, std::string> probes_; // under way: of which names
    std::uint64_t last_probe_ = 0;
    time_point probe_debt_{};
    time_point begun_{};
    entries peers_;
    std::list<named_entry*> by_news_; // the latest last
    run_index<named_entry> by_epoch_;
    std::unique_ptr<rival> namesake_; // of this node itself
    std::optional<known_run> own_;    // as it announces itself
    time_point own_since_{};
    ended_runs ended_;
    std::uint64_t news_ = 0;
    time_point excused_ = time_point::min();
};

} // namespace cles::core
