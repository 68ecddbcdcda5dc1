// SPDX-License-Identifier: BSL-1.0
#include "commands/trace_tree.hpp"

#include "output/statistics.hpp"
#include "output/table.hpp"
#include "output/terminal.hpp"

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <map>
#include <set>
#include <string_view>
#include <utility>

namespace tool {
namespace {

constexpr std::size_t max_depth = 64; // more hops are not possible, unless a node lies

/// The spans of all nodes, by their parents, in the order in which they began there.
class span_index {
  public:
    explicit span_index(const std::vector<trace_document>& nodes) {
        for (const auto& node : nodes) {
            for (const auto& span : node.spans) {
                (span.kind == "sent" ? sent_ : received_).emplace(span.parent, entry{&node.node, &span});
            }
        }
    }

    /// Where a request that was sent as this span has been received.
    std::vector<hop> receivers(const std::string& sent, double sender_us, std::size_t depth) {
        std::vector<hop> found;
        const auto [begin, end] = received_.equal_range(sent);
        for (auto at = begin; at != end && depth < max_depth; ++at) {
            const auto& [node, span] = at->second;
            if (shown_.insert(span).second) {
                found.push_back(hop_of(*node, *span, depth));
                if (span->total_us) {
                    found.back().link_us = std::max(sender_us - *span->total_us, 0.0);
                }
            }
        }
        return found;
    }

    /// Those whose sender is not known, for example because it did not tell its spans.
    std::vector<hop> others() {
        std::vector<hop> found;
        for (const auto& [parent, each] : received_) {
            if (shown_.insert(each.span).second) {
                found.push_back(hop_of(*each.node, *each.span, 0));
            }
        }
        return found;
    }

  private:
    struct entry {
        const std::string* node;
        const span_document* span;
    };

    hop hop_of(const std::string& node, const span_document& span, std::size_t depth) {
        hop made{.node = node,
                 .request = span.verb + " " + span.task,
                 .total_us = span.total_us,
                 .queue_us = span.queue_us,
                 .run_us = span.run_us,
                 .outcome = span.outcome};
        std::vector<const span_document*> sent;
        const auto [begin, end] = sent_.equal_range(span.span);
        std::transform(begin, end, std::back_inserter(sent), [](const auto& each) { return each.second.span; });
        std::stable_sort(sent.begin(), sent.end(),
                         [](const auto* a, const auto* b) { return a->start_us < b->start_us; });
        for (const auto* each : sent) {
            auto next = receivers(each->span, each->total_us.value_or(0), depth + 1);
            if (next.empty()) {
                next.push_back({.node = each->next.value_or(each->target),
                                .request = each->verb + " " + each->task,
                                .total_us = each->total_us,
                                .outcome = each->outcome});
            }
            std::move(next.begin(), next.end(), std::back_inserter(made.hops));
        }
        return made;
    }

    std::multimap<std::string_view, entry> sent_;
    std::multimap<std::string_view, entry> received_;
    std::set<const span_document*> shown_;
};

std::string ms_text(const std::optional<double>& us) { return us ? fixed(*us / 1000, 3) : "-"; }

void add_rows(table& out, const hop& each, const std::string& before, const std::string& below) {
    out.row();
    out.set(0, before + printable(each.node + " " + each.request));
    std::size_t column = 0;
    for (const auto& time : {each.total_us, each.link_us, each.queue_us, each.run_us}) {
        out.set(++column, ms_text(time), true);
    }
    out.set(++column, printable(each.outcome.value_or("not ended")));
    for (std::size_t i = 0; i < each.hops.size(); ++i) {
        const bool last = i + 1 == each.hops.size();
        add_rows(out, each.hops[i], below + (last ? "└─ " : "├─ "), below + (last ? "   " : "│  "));
    }
}

} // namespace

std::vector<hop> hops_of(const std::vector<trace_document>& nodes, const std::string& root, double total_us) {
    span_index spans{nodes};
    auto found = spans.receivers(root, total_us, 0);
    auto others = spans.others();
    std::move(others.begin(), others.end(), std::back_inserter(found));
    return found;
}

std::string to_table(const hop& sender) {
    table out{"HOP", "TOTAL MS", "LINK MS", "QUEUE MS", "RUN MS", "OUTCOME"};
    add_rows(out, sender, "", "");
    return out.text();
}

} // namespace tool
