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

/// A fault that is planted in the harness, in the network or in a double of what surrounds the machines, so that it can
/// be seen that the simulation finds it. The machines themselves are never changed.
BOOST_DEFINE_FIXED_ENUM_CLASS(planted, std::uint8_t,
                              none,              //
                              stream_repeats,    ///< a stream hands a PUSH over twice
                              source_swapped,    ///< a copy of a datagram comes from another port
                              timer_late,        ///< the timer of a node goes off too late
                              replies_swapped,   ///< of two replies on a stream the second comes first
                              update_repeated,   ///< a feed hands an update to its program twice
                              gap_hidden,        ///< a feed keeps a gap to itself
                              ids_exchanged,     ///< two replies bear each other's ids
                              datagram_long,     ///< the path takes more than it should say
                              never_full,        ///< a link never says that its peer does not read
                              call_kept,         ///< a handler is never let go of
                              source_kept,       ///< a source of datagrams is never let go of
                              partition_stays,   ///< two hosts do not reach each other any more
                              rebind_forgotten,  ///< a lost feed is not bound again
                              rebind_hurried,    ///< a lost feed is bound again without a pause
                              chance_leaks,      ///< something else than the seed decides
                              announcements_end, ///< a node announces itself no more
                              excuse_forgotten,  ///< a node that was stopped takes the others for silent
                              farewell_unheard,  ///< nobody hears that a node leaves
                              names_given_up,    ///< a node that has just begun waits for no name
                              clash_kept,        ///< nobody is told of a clash
                              group_repeated,    ///< a feed by the group hands an update to its program twice
                              group_gap_hidden,  ///< a feed by the group keeps a gap to itself
                              lease_lapses,      ///< a binding by the group is not renewed
                              group_sends_twice, ///< each update goes to the group twice
                              repeat_swallowed,  ///< a new binder does not get the last update
                              way_repeats,       ///< a router passes each request on twice
                              queue_boundless,   ///< a daemon's queue takes more than it may
                              stuck_unnoticed,   ///< nobody looks for workers that are stuck
                              urgent_lost,       ///< a stream loses what is urgent
                              finish_resets);    ///< a link that is to end in order is reset

inline std::string_view to_string(planted p) noexcept { return boost::describe::enum_to_string(p, ""); }

/// What a planted fault does to the lines that a stream is about to carry; nothing, where none is planted.
class tampering {
  public:
    explicit tampering(planted fault) noexcept : fault_(fault) {}

    void apply(std::string& lines, const std::weak_ptr<place>& sender, dice& chance);

  private:
    planted fault_;
    // Which nouns each has bound.
    std::map<std::weak_ptr<place>, std::set<std::string, std::less<>>, std::owner_less<>> bound_;
};

} // namespace cles::simulation
