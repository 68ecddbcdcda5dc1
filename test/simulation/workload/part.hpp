// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "node/membership/membership.hpp"
#include "port/group_port.hpp"
#include "simulation/world/plan.hpp"

#include <memory>
#include <string_view>

namespace cles::simulation {

class node_run;
class world;

/// A part of what the simulated world does: one kind of life in it, with what has to hold of it. To simulate more, add
/// a deed (plan.hpp), have the planner think of it (make_plan.cpp), and a part that does it and judges what comes of it
/// (world.cpp lists them).
class part {
  public:
    part() = default;
    part(const part&) = delete;
    part& operator=(const part&) = delete;
    virtual ~part() = default;

    /// Does it, where it is one of its own.
    virtual void perform(const action& what) = 0;
    /// A node has begun: what it offers.
    virtual void on_start(node_run&) {}
    /// A node is about to leave in order.
    virtual void on_leaving(node_run&) {}
    /// A node is about to be gone with all that it held.
    virtual void on_crash(node_run&) {}
    /// A node is about to be handed a datagram of the multicast group, or about to send one.
    virtual void on_group_heard(node_run&, const core::group_source&, std::string_view) {}
    virtual void on_group_sent(node_run&, std::string_view) {}
    /// A node says that something about another one has changed.
    virtual void on_neighbour(node_run&, std::string_view, core::membership::change) {}
    /// The trouble is over, just now.
    virtual void on_calm() {}
    /// The trouble is over, and was for a while: tries what has to work again; later it is judged whether it did.
    virtual void probe() {}
    virtual void judge_probe() {}
    /// All that goes on by itself ends.
    virtual void wind_down() {}
    /// All has been quiet for long.
    virtual void judge_rest() {}
};

/// Requests and what serves them: every node asks every other for all verbs but BIND, has some withdrawn, and answers
/// at once, later, or never. Each request bears a number of its own, which its answer tells.
std::unique_ptr<part> make_asking(world& in);

/// Publishing and following: every node publishes some nouns, and follows those of others, by links and by the
/// multicast group, there by name or those of all. What each publisher has been asked for in the group, and has sent
/// there, is kept account of.
std::unique_ptr<part> make_following(world& in);

/// People with netcat: clients on streams whose requests bear no id, and who therefore count on the order of answers.
/// They send faster than they are answered, make mistakes, read slowly, and end in each way there is.
std::unique_ptr<part> make_talking(world& in);

/// Who is there: nodes announce themselves to the group, leave it in order or without a word, begin again, and some
/// bear another's name. What each has heard is kept account of, to judge what it makes of that.
std::unique_ptr<part> make_neighbouring(world& in);

} // namespace cles::simulation
