// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/identity.hpp>
#include <cles/limits.hpp>

#include "core/bind_decision.hpp"
#include "core/held_request.hpp"
#include "core/node.hpp"
#include "port/group_source.hpp"

#include <cstddef>
#include <functional>
#include <list>
#include <memory>
#include <string_view>

namespace cles::core {

/// Bindings that the group asks for and on which a handler has not decided yet.
class group_welcomes {
  public:
    static constexpr std::size_t most = 256;

    /// \param welcome is called for each that may be
    using welcomed = std::function<void(const group_source& from, const protocol::request_line& bind)>;
    group_welcomes(std::shared_ptr<node> host, welcomed welcome)
        : node_(std::move(host)), welcome_(std::move(welcome)) {}
    group_welcomes(const group_welcomes&) = delete;
    group_welcomes& operator=(const group_welcomes&) = delete;
    ~group_welcomes() { clear(); }

    /// False where too many wait. What is asked once more while it waits is one.
    bool ask(const group_source& from, const identity& peer, const protocol::request_line& bind, time_point now);
    /// It is not wanted any more.
    void drop(const group_source& from, const protocol::request_line& bind);
    void clear();

  private:
    struct waiting {
        waiting(const group_source& source, identity who, const protocol::request_line& r)
            : from(source), peer(std::move(who)), bind(r) {}
        group_source from;
        identity peer;
        held_request bind;
        std::shared_ptr<bind_decision> decision{};
    };
    std::list<waiting>::iterator find(const group_source& from, std::string_view path);

    std::shared_ptr<node> node_;
    welcomed welcome_;
    std::list<waiting> waiting_;
};

} // namespace cles::core
