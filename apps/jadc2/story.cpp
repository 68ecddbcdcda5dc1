// SPDX-License-Identifier: BSL-1.0
#include "story.hpp"

#include <array>
#include <cstdio>

namespace jadc2 {

story begin_story(const picture& seen, const fmv::track& target, double received_utc, double decided_utc) {
    const double until_published_ms = (seen.published - seen.captured) * 1000;
    return {.target = target.id,
            .frame = seen.frame,
            .processed_by = seen.by,
            .encode_ms = seen.encode_ms,
            .fmv_way_ms = seen.way_ms,
            .fmv_queue_ms = seen.queue_ms,
            .fmv_run_ms = seen.run_ms,
            .publish_ms = until_published_ms - seen.encode_ms - seen.way_ms - seen.queue_ms - seen.run_ms,
            .tracks_way_ms = (received_utc - seen.published) * 1000,
            .decide_ms = (decided_utc - received_utc) * 1000,
            .data_to_decision_ms = (decided_utc - seen.captured) * 1000};
}

std::vector<std::string> lines_of(const story& what) {
    std::vector<std::string> lines;
    const auto row = [&lines](const std::string& name, double ms) {
        std::array<char, 128> line{};
        std::snprintf(line.data(), line.size(), "%-44s %10.3f ms", name.c_str(), ms);
        lines.emplace_back(line.data());
    };
    row("frame " + std::to_string(what.frame) + " captured and encoded", what.encode_ms);
    row("to " + what.processed_by + " and back", what.fmv_way_ms);
    row("waited at " + what.processed_by, what.fmv_queue_ms);
    row("processed at " + what.processed_by, what.fmv_run_ms);
    row("published", what.publish_ms);
    row("to the mission centre", what.tracks_way_ms);
    row("decided", what.decide_ms);
    row("data to decision", what.data_to_decision_ms);
    if (!what.struck_by.empty()) {
        row("to " + what.struck_by + " and back", what.strike_way_ms);
        row("carried out at " + what.struck_by, what.strike_run_ms);
        row("data to answer", what.data_to_answer_ms);
    }
    return lines;
}

} // namespace jadc2
