// SPDX-License-Identifier: BSL-1.0
#include "gateway/told/spans.hpp"

#include <cles/convert.hpp>

#include "gateway/http/message.hpp"
#include "gateway/told/told_limits.hpp"
#include "options/arguments.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <set>
#include <utility>

namespace gateway {
namespace {

constexpr std::size_t deepest_span = 64;
constexpr std::size_t trace_digits = 32;
constexpr std::size_t span_digits = 16;

bool is_id(std::string_view text, std::size_t digits) noexcept {
    return text.size() == digits && text.find_first_not_of("0123456789abcdef") == std::string_view::npos &&
           text.find_first_not_of('0') != std::string_view::npos;
}

bool is_short(const std::string& text) noexcept { return text.size() <= told_limits::text_of_span; }

// Otherwise a collector would refuse all that it is sent with, or what waits for it would have no limit.
bool is_usable(const tool::trace_document& node, const tool::span_document& span) {
    return is_id(span.span, span_digits) && is_short(node.node) && is_short(span.parent) && is_short(span.kind) &&
           is_short(span.verb) && is_short(span.target) && is_short(span.task) &&
           (!span.next || is_short(*span.next)) && (!span.outcome || is_short(*span.outcome));
}

std::int64_t ns_of(double us) noexcept {
    constexpr double longest_us = 1e12; // 11 days: what a node states may be anything
    constexpr double per_us = 1000;
    return std::isfinite(us) ? static_cast<std::int64_t>(std::clamp(us, 0.0, longest_us) * per_us) : 0;
}

class placement {
  public:
    explicit placement(const std::vector<tool::trace_document>& nodes) {
        for (const auto& node : nodes) {
            for (const auto& span : node.spans) {
                if (is_usable(node, span)) {
                    (span.kind == "sent" ? sent_ : received_).emplace(span.parent, entry{&node, &span});
                }
            }
        }
    }

    std::vector<placed_span> take(const placed_span& root) {
        place(sent_, root.id, nullptr, root.start_ns, 0, 0, 0);
        return std::move(placed_);
    }

  private:
    struct entry {
        const tool::trace_document* document;
        const tool::span_document* span;
    };
    using by_parent = std::multimap<std::string_view, entry>;

    /// Places the spans that this one has caused. \param document of the cause; null: of the gateway, whose node begins
    /// to count with the first
    // NOLINTNEXTLINE(misc-no-recursion): limited
    void place(const by_parent& all, std::string_view cause, const tool::trace_document* document, std::int64_t start,
               double start_us, double total_us, std::size_t depth) {
        const auto [begin, end] = all.equal_range(cause);
        for (auto at = begin; at != end; ++at) {
            const auto& [there, span] = at->second;
            const bool is_sent = &all == &sent_;
            const bool is_same_clock = document == nullptr || there == document;
            if (depth > deepest_span || (is_sent && !is_same_clock) || !seen_.insert(span).second) {
                continue;
            }
            const auto total = span->total_us.value_or(0);
            const auto from = start + ns_of(is_same_clock ? span->start_us - start_us : (total_us - total) / 2);
            placed_.push_back({.node = there->node,
                               .id = span->span,
                               .parent = span->parent,
                               .name = span->verb + " " + span->task,
                               .is_client = is_sent,
                               .start_ns = from,
                               .end_ns = from + ns_of(total),
                               .outcome = span->outcome.value_or(std::string{})});
            place(is_sent ? received_ : sent_, span->span, there, from, span->start_us, total, depth + 1);
        }
    }

    by_parent sent_;
    by_parent received_;
    std::set<const tool::span_document*> seen_;
    std::vector<placed_span> placed_;
};

std::string attribute(std::string_view key, std::string_view value) {
    return R"({"key":)" + json_string(key) + R"(,"value":{"stringValue":)" + json_string(value) + "}}";
}

std::string span_text(const std::string& trace, const placed_span& span) {
    const auto status = span.outcome == "ok" ? "1" : span.outcome.empty() ? "0" : "2";
    auto out = R"({"traceId":")" + trace + R"(","spanId":")" + span.id + R"(",)";
    out.append(span.parent.empty() ? std::string{} : R"("parentSpanId":)" + json_string(span.parent) + ",");
    out.append(R"("name":)").append(json_string(span.name));
    out.append(R"(,"kind":)").append(span.is_client ? "3" : "2");
    out.append(R"(,"startTimeUnixNano":")").append(std::to_string(span.start_ns));
    out.append(R"(","endTimeUnixNano":")").append(std::to_string(span.end_ns)).append(R"(","attributes":[)");
    out.append(span.outcome.empty() ? std::string{} : attribute("cles.outcome", span.outcome));
    return out.append(R"(],"status":{"code":)").append(status).append("}}");
}

} // namespace

trace_parent parse_trace_parent(std::string_view text) {
    constexpr std::size_t span_at = 3 + trace_digits + 1;
    constexpr std::size_t flags_at = span_at + span_digits + 1;
    const bool has_form =
        text.size() == flags_at + 2 && text.starts_with("00-") && text[span_at - 1] == '-' && text[flags_at - 1] == '-';
    if (!has_form || !is_id(text.substr(3, trace_digits), trace_digits) ||
        !is_id(text.substr(span_at, span_digits), span_digits)) {
        return {};
    }
    return {.trace = std::string{text.substr(3, trace_digits)},
            .span = std::string{text.substr(span_at, span_digits)},
            .is_sampled = std::string_view{"13579bdf"}.find(text.back()) != std::string_view::npos};
}

std::string to_text(const trace_parent& parent) {
    return "00-" + parent.trace + "-" + parent.span + (parent.is_sampled ? "-01" : "-00");
}

tool::trace_document read_trace(std::string_view reply) {
    auto read = cles::from_json<tool::trace_document>(reply);
    std::erase_if(read.spans, [&read](const auto& span) { return !is_usable(read, span); });
    if (read.spans.size() > told_limits::spans) {
        read.spans.resize(told_limits::spans);
    }
    return read;
}

void add_nodes(const tool::trace_document& document, std::vector<std::string>& names, std::size_t most) {
    for (const auto& span : document.spans) {
        for (const auto& name : {span.next.value_or(std::string{}), span.target}) {
            if (names.size() >= most) {
                return;
            }
            const bool is_node = !name.empty() && !tool::stands_for_others(name);
            if (span.kind == "sent" && is_node && std::ranges::find(names, name) == names.end()) {
                names.push_back(name);
            }
        }
    }
}

std::vector<placed_span> place_spans(const placed_span& root, const std::vector<tool::trace_document>& nodes) {
    return placement{nodes}.take(root);
}

std::string otlp_document(const std::vector<traced_span>& spans) {
    std::map<std::string_view, std::string> by_node;
    for (const auto& each : spans) {
        auto& all = by_node[each.span.node];
        all.append(all.empty() ? "" : ",").append(span_text(each.trace, each.span));
    }
    std::string out;
    for (const auto& [node, all] : by_node) {
        out.append(out.empty() ? "" : ",")
            .append(R"({"resource":{"attributes":[)")
            .append(attribute("service.name", node));
        out.append(R"(]},"scopeSpans":[{"scope":{"name":"cles"},"spans":[)").append(all).append("]}]}");
    }
    return R"({"resourceSpans":[)" + out + "]}";
}

} // namespace gateway
