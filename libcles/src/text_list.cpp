// SPDX-License-Identifier: BSL-1.0
#include <cles/text_list.hpp>

#include <utility>

namespace cles {

text_list::text_list(std::initializer_list<std::string> texts) : vector(texts) {}
text_list::text_list(const vector& texts) : vector(texts) {}
text_list::text_list(vector&& texts) noexcept : vector(std::move(texts)) {}
text_list::text_list(const text_list& other) = default;
text_list::text_list(text_list&& other) noexcept = default;
text_list& text_list::operator=(const text_list& other) = default;
text_list& text_list::operator=(text_list&& other) noexcept = default;
text_list::~text_list() = default;

} // namespace cles
