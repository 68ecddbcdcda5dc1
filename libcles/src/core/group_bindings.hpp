// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "core/deadlines.hpp"
#include "core/group_output.hpp"
#include "core/jitter.hpp"
#include "core/link_bindings.hpp"
#include "core/node.hpp"
#include "port/group_source.hpp"
#include "protocol/message.hpp"

#include <boost/unordered/unordered_flat_map.hpp>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

namespace cles::core {

/// What the nodes of the group are bound to here, by one interface. To a noun's topic it is one binder, for as long as
/// at least one source has a lease of it: so each update goes out once by each interface by which somebody is bound,
/// however many hear it there.
///
/// A lease of what nobody has published yet is kept too: the first publication finds its binders.
class group_bindings final : private binder, private publications::observer {
  public:
    /// The least time between two repeats of a noun's last update, and the most by which one is put off at random.
    static constexpr std::chrono::milliseconds repeat_apart{250};

    group_bindings(node& host, group_output& out, std::uint32_t seed);
    ~group_bindings();

    /// Begins a lease, renews it, or ends it. A source that is new to the noun has its last update repeated: soon where
    /// every publisher was asked, at once where it was this node alone. False where there are as many leases as may be.
    bool bind(const group_source& from, const protocol::request_line& request, time_point now);
    /// Sends what waits: there is room again.
    void drain(time_point now) { bound_.drain(now); }
    void clear();

  private:
    struct noun;
    struct lease final : deadline {
        lease(noun& what, const group_source& whose) : of(what), from(whose) {}
        void on_deadline(time_point now) override;

        noun& of;
        group_source from;
    };
    struct noun final : deadline { // due when its last update is to be repeated
        noun(group_bindings& all, std::string what) : owner(all), path(std::move(what)) {}
        void on_deadline(time_point now) override { owner.repeat(*this, now); }

        group_bindings& owner;
        std::string path;
        std::map<group_source, lease> leases;
        std::uint64_t repeat_of = 0; // one that follows takes its place
        std::optional<time_point> repeated_at;
    };

    [[nodiscard]] bool has_room_for(const group_source& from) const;
    void end(noun& n, const group_source& from);
    void attach(topic& t);
    void repeat_soon(noun& n, bool put_off, time_point now);
    void repeat(noun& n, time_point now);
    void note_too_large(std::string_view line);
    void send(std::string_view lines);

    // binder
    [[nodiscard]] bool takes_updates() const override { return out_.has_room(); }
    void put_updates(std::string_view lines) override;
    // publications::observer
    void on_opened(topic& made) override;

    node& node_;
    group_output& out_;
    jitter jitter_;
    link_bindings bound_;
    std::map<std::string, std::unique_ptr<noun>, std::less<>> nouns_;
    boost::unordered_flat_map<group_source, std::size_t> of_source_; // leases
    std::optional<time_point> noted_at_;
};

} // namespace cles::core
