// SPDX-License-Identifier: BSL-1.0
#include "commands/node_rates.hpp"

#include "output/json_node.hpp"

#include <charconv>
#include <system_error>

namespace tool {
namespace {

template <class T>
std::optional<T> number_in(const json_node* node) {
    T value{};
    if (node == nullptr || node->kind != json_node::type::other) {
        return {};
    }
    const auto* end = node->text.data() + node->text.size();
    const auto [rest, code] = std::from_chars(node->text.data(), end, value);
    return code == std::errc{} && rest == end ? std::optional{value} : std::nullopt;
}

double rate(std::uint64_t before, std::uint64_t after, double seconds) {
    return after <= before ? 0 : static_cast<double>(after - before) / seconds;
}

} // namespace

node_rate node_rates::take(const std::string& run, std::string_view metrics, time_point now) {
    const auto told = parse_json(metrics);
    counted here{.when = now};
    if (const auto* requests = told.find("requests"); requests != nullptr) {
        for (const auto& [verb, count] : requests->members) {
            here.requests += number_in<std::uint64_t>(&count).value_or(0);
        }
    }
    here.errors = number_in<std::uint64_t>(told.find("errors")).value_or(0);

    node_rate out;
    if (const auto* times = told.find("handler_us");
        times != nullptr && number_in<std::uint64_t>(times->find("samples")).value_or(0) > 0) {
        out.p50_us = number_in<double>(times->find("p50"));
        out.p99_us = number_in<double>(times->find("p99"));
    }
    const auto before = last_.find(run);
    if (before != last_.end() && now > before->second.when) {
        const auto seconds = std::chrono::duration<double>{now - before->second.when}.count();
        out.requests = rate(before->second.requests + 1, here.requests, seconds); // one was this question
        out.errors = rate(before->second.errors, here.errors, seconds);
    }
    last_[run] = here;
    return out;
}

void node_rates::forget_before(time_point when) {
    std::erase_if(last_, [&](const auto& each) { return each.second.when < when; });
}

} // namespace tool
