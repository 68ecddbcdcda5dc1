// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "picture.hpp"
#include "strike/order.hpp"

#include <boost/describe/class.hpp>

#include <cstdint>
#include <string>
#include <vector>

namespace jadc2 {

/// The steps of one strike, from the camera to the answer. The duration of a step between two hosts is as accurate as
/// their clocks.
struct story {
    std::string order{};
    std::uint64_t target = 0; ///< the track's number
    std::uint64_t frame = 0;  ///< on which the decision is based
    std::string fate{};       ///< see `order_fates`
    std::string trouble{};    ///< why it failed
    std::string processed_by{};
    std::string struck_by{};
    double encode_ms = 0;  ///< from capture until sending
    double fmv_way_ms = 0; ///< there and back
    double fmv_queue_ms = 0;
    double fmv_run_ms = 0;
    double publish_ms = 0;    ///< from the answer until it is published
    double tracks_way_ms = 0; ///< from there to the mission centre
    double decide_ms = 0;
    double data_to_decision_ms = 0; ///< the sum of these
    double strike_way_ms = 0;       ///< there and back
    double strike_run_ms = 0;
    double data_to_answer_ms = 0; ///< the sum of all
    strike::outcome outcome{};
};
BOOST_DESCRIBE_STRUCT(story, (),
                      (order, target, frame, fate, trouble, processed_by, struck_by, encode_ms, fmv_way_ms,
                       fmv_queue_ms, fmv_run_ms, publish_ms, tracks_way_ms, decide_ms, data_to_decision_ms,
                       strike_way_ms, strike_run_ms, data_to_answer_ms, outcome))

/// The part until the decision.
story begin_story(const picture& seen, const fmv::track& target, double received_utc, double decided_utc);

/// A line for each step.
std::vector<std::string> lines_of(const story& what);

} // namespace jadc2
