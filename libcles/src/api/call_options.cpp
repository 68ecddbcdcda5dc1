// SPDX-License-Identifier: BSL-1.0
#include <cles/call_options.hpp>

#include <utility>

namespace cles {

// Not in the header: there, g++ 12 may inline it into a coroutine together with a copy of the options, and then warns
// that an empty lambda in them is not initialised.
call_options& call_options::on_progress(std::function<void(double, std::string_view)> callback) {
    on_progress_ = std::move(callback);
    return *this;
}

call_options& call_options::deadline(std::chrono::milliseconds limit) {
    deadline_ = limit;
    return *this;
}

call_options& call_options::at(std::string_view url, std::string_view node) {
    at_ = url;
    at_node_ = node;
    return *this;
}

call_options& call_options::urgent(bool value) {
    urgent_ = value;
    return *this;
}

call_options& call_options::hops(std::uint32_t most) {
    hops_ = most;
    return *this;
}

call_options& call_options::on_behalf_of(std::string_view member) {
    is_on_behalf_ = true;
    on_behalf_of_ = member;
    return *this;
}

call_options& call_options::trace(std::string_view parent) {
    trace_ = parent;
    return *this;
}

call_options& call_options::diagnostics(std::string& text) {
    diagnostics_ = &text;
    return *this;
}

call_options& call_options::failure(std::string& json) {
    failure_ = &json;
    return *this;
}

bind_options& bind_options::keep(std::uint32_t updates) {
    keep_ = updates;
    return *this;
}

bind_options& bind_options::mark(bool wanted) {
    mark_ = wanted;
    return *this;
}

bind_options& bind_options::deadline(std::chrono::milliseconds limit) {
    call_options::deadline(limit);
    return *this;
}

bind_options& bind_options::at(std::string_view url, std::string_view node) {
    call_options::at(url, node);
    return *this;
}

bind_options& bind_options::hops(std::uint32_t most) {
    call_options::hops(most);
    return *this;
}

bind_options& bind_options::on_behalf_of(std::string_view member) {
    call_options::on_behalf_of(member);
    return *this;
}

bind_options& bind_options::diagnostics(std::string& text) {
    call_options::diagnostics(text);
    return *this;
}

} // namespace cles
