// SPDX-License-Identifier: BSL-1.0
#include <cles/owned_request.hpp>
#include <cles/request.hpp>

#include "json/json_scan.hpp"

#include <cmath>
#include <type_traits>

namespace cles {
namespace detail {
namespace {

constexpr std::size_t max_retained = 16384; // bytes of memory that a cleared copy keeps

// A request and its peer, allocated together.
struct copy_with_peer {
    explicit copy_with_peer(const request_data& data) : peer(*data.peer) {
        what.assign(request{data}, {std::shared_ptr<const identity>{}, &peer}); // does not own it
    }

    identity peer;
    owned_request what;
};

} // namespace

void owned_request::assign(const request& what, std::shared_ptr<const identity> peer) {
    auto size = what.node().size() + what.task().size() + what.body().size() + what.trace().size() +
                what.requester().size() + what.forwarded_by().size();
    for (const auto p : what.parameters()) {
        size += p.size();
    }
    text_.clear();
    text_.reserve(size); // the views must stay valid
    const auto copy = [this](std::string_view part) {
        const auto at = text_.size();
        text_.append(part);
        return std::string_view{text_}.substr(at);
    };
    peer_ = std::move(peer);
    data_.verb = what.verb();
    data_.node = copy(what.node());
    data_.task = copy(what.task());
    data_.body = copy(what.body());
    data_.trace = copy(what.trace());
    data_.requester = copy(what.requester());
    data_.forwarded_by = copy(what.forwarded_by());
    parameters_.clear();
    parameters_.reserve(what.parameters().size());
    for (const auto p : what.parameters()) {
        parameters_.push_back(copy(p));
    }
    data_.parameters = parameters_;
    data_.peer = peer_.get();
    data_.deadline = what.deadline();
}

void owned_request::clear() {
    peer_.reset();
    data_ = {};
    if (text_.capacity() > max_retained) {
        text_ = {};
    }
}

std::shared_ptr<const request_data> own(const request_data& data) {
    const auto copy = std::make_shared<copy_with_peer>(data);
    return {copy, &copy->what.data()};
}

template <class T>
bool read_number(std::string_view text, T& number) noexcept {
    const bool is_number = json_detail::read_number(text, number);
    if constexpr (std::is_floating_point_v<T>) {
        return is_number && std::isfinite(number); // it reads words such as `inf`, too
    } else {
        return is_number;
    }
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

void throw_bad_parameter(std::size_t index) {
    throw error(errc::bad_request, "parameter " + std::to_string(index + 1) + " is not a valid number");
}

void throw_bad_body(const std::string& why) { throw error(errc::bad_request, "the body is invalid: " + why); }

} // namespace detail

std::string_view request::parameter_text(std::size_t index) const {
    if (index >= parameters().size()) {
        throw error(errc::bad_request, "parameter " + std::to_string(index + 1) + " is missing");
    }
    return parameters()[index];
}

} // namespace cles
