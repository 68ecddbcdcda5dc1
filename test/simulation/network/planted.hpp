// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "simulation/network/dice.hpp"
#include "simulation/network/place.hpp"

#include <boost/describe/enum.hpp>
#include <boost/describe/enum_to_string.hpp>

#include <cstdint>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <string_view>

namespace cles::simulation {

/// A fault that is planted in the harness, in the network or in a double of the library's environment, to show that the
/// simulation detects it. The library's own classes are never changed.
BOOST_DEFINE_FIXED_ENUM_CLASS(planted, std::uint8_t,
                              none,               //
                              stream_repeats,     ///< a stream delivers a PUSH twice
                              source_swapped,     ///< a copy of a datagram comes from another port
                              timer_late,         ///< the timer of a node expires too late
                              replies_swapped,    ///< two replies on a stream are reordered
                              update_repeated,    ///< a feed delivers an update to its program twice
                              gap_hidden,         ///< a feed does not report a gap
                              ids_exchanged,      ///< the ids of two replies are exchanged
                              datagram_long,      ///< the path accepts larger datagrams than it reports
                              never_full,         ///< a link does not report unsent output
                              call_kept,          ///< a handler is never released
                              source_kept,        ///< a source of datagrams is never released
                              partition_stays,    ///< two hosts cannot reach each other any more
                              rebind_forgotten,   ///< a lost feed is not bound again
                              rebind_hurried,     ///< a lost feed is bound again without a pause
                              chance_leaks,       ///< something other than the seed determines the run
                              announcements_end,  ///< a node stops announcing itself
                              excuse_forgotten,   ///< a node that was stopped considers the others silent
                              farewell_unheard,   ///< a node's farewell is not received
                              names_given_up,     ///< a node that has just started does not wait for names
                              clash_kept,         ///< a name conflict is not reported
                              group_repeated,     ///< a group feed delivers an update to its program twice
                              group_gap_hidden,   ///< a group feed does not report a gap
                              lease_lapses,       ///< a group binding is not renewed
                              group_sends_twice,  ///< each update is sent to the group twice
                              repeat_swallowed,   ///< a new subscriber does not receive the last update
                              way_repeats,        ///< a router forwards each request twice
                              queue_boundless,    ///< a daemon's queue exceeds its limit
                              stuck_unnoticed,    ///< stuck workers are not detected
                              links_ignored,      ///< the nodes of a mesh state no `links`
                              route_withheld,     ///< a node of a mesh forwards nothing
                              moved_run_again,    ///< a pool runs a job that another node has been given
                              moved_twice,        ///< a node forwards each job that it moves twice
                              slots_overstated,   ///< a pool reports busy workers as free
                              urgent_lost,        ///< a stream loses urgent lines
                              finish_resets,      ///< a link that finishes is reset
                              forgery_taken,      ///< a line that is not sealed counts as that of a member
                              replay_taken,       ///< a repeated datagram is delivered again
                              group_replay_taken, ///< the same in the group
                              stranger_admitted,  ///< a stream is opened to anyone who states a member's name
                              removed_served,     ///< links to a removed member go on
                              rights_ignored,     ///< a node permits everything
                              roster_withheld,    ///< the newest roster is given to no node
                              roster_rolled_back, ///< a node that restarts has an old roster
                              welcome_late,       ///< handshakes over datagrams take long
                              salt_repeated);     ///< a node that restarts draws the same random numbers

inline std::string_view to_string(planted p) noexcept { return boost::describe::enum_to_string(p, ""); }

/// Applies a planted fault to the lines that a stream is about to carry; without one, changes nothing.
class tampering {
  public:
    explicit tampering(planted fault) noexcept : fault_(fault) {}

    void apply(std::string& lines, const std::weak_ptr<place>& sender, dice& chance);

  private:
    planted fault_;
    // The nouns that each has bound.
    std::map<std::weak_ptr<place>, std::set<std::string, std::less<>>, std::owner_less<>> bound_;
};

} // namespace cles::simulation
