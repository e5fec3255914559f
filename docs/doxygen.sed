# The headers' comments as Doxygen reads them: of the file, before what they describe, and behind members. A ">" that
# begins a comment is a sign, no quotation.
s|^.*NOLINT.*$||
s|^/\* ---- .*$||
1s|^/\*$|/** @file|
1s|^// |/// @file\n/// |
2,4s|^// |/// |
s|^( *)/\* |\1/** |
s|^([^/]*[^ /].*)/\* |\1/**< |
s|(/\*\*<?) > |\1 \&gt; |
