// SPDX-License-Identifier: BSL-1.0
#include <cles/request.hpp>

#include <charconv>
#include <system_error>
#include <vector>

namespace cles {
namespace {

// All text of a request in one piece, and the views that point into it.
struct owned_request {
    std::string text;
    std::vector<std::string_view> parameters;
    identity peer;
    detail::request_data data;
};

} // namespace

namespace detail {

std::shared_ptr<const request_data> own(const request_data& data) {
    const auto copy = std::make_shared<owned_request>();
    auto& text = copy->text;
    auto size = data.node.size() + data.task.size() + data.body.size();
    for (const auto p : data.parameters) {
        size += p.size();
    }
    text.reserve(size); // the views must stay
    const auto keep = [&](std::string_view part) {
        const auto at = text.size();
        text.append(part);
        return std::string_view{text}.substr(at);
    };
    copy->peer = *data.peer;
    copy->data = data;
    copy->data.node = keep(data.node);
    copy->data.task = keep(data.task);
    copy->data.body = keep(data.body);
    copy->parameters.reserve(data.parameters.size());
    for (const auto p : data.parameters) {
        copy->parameters.push_back(keep(p));
    }
    copy->data.parameters = copy->parameters;
    copy->data.peer = &copy->peer;
    return {copy, &copy->data};
}

template <class T>
bool read_number(std::string_view text, T& number) noexcept {
    const auto* const end = text.data() + text.size();
    const auto [stop, code] = std::from_chars(text.data(), end, number);
    return code == std::errc{} && stop == end;
}
template bool read_number(std::string_view, char&) noexcept;
template bool read_number(std::string_view, signed char&) noexcept;
template bool read_number(std::string_view, unsigned char&) noexcept;
template bool read_number(std::string_view, short&) noexcept;
template bool read_number(std::string_view, unsigned short&) noexcept;
template bool read_number(std::string_view, int&) noexcept;
template bool read_number(std::string_view, unsigned&) noexcept;
template bool read_number(std::string_view, long&) noexcept;
template bool read_number(std::string_view, unsigned long&) noexcept;
template bool read_number(std::string_view, long long&) noexcept;
template bool read_number(std::string_view, unsigned long long&) noexcept;
template bool read_number(std::string_view, float&) noexcept;
template bool read_number(std::string_view, double&) noexcept;
template bool read_number(std::string_view, long double&) noexcept;

} // namespace detail

std::string_view request::parameter_text(std::size_t index) const {
    if (index >= parameters().size()) {
        throw error(errc::bad_request, "parameter " + std::to_string(index + 1) + " is missing");
    }
    return parameters()[index];
}

} // namespace cles
