import { Stack, Text, Title } from "@mantine/core";
import { useTitle } from "../../ui/useTitle";

/** An example of a page. */
export function AboutPage() {
  useTitle("About");
  return (
    <Stack>
      <Title order={1}>About</Title>
      <Text>Gains in a few flights.</Text>
    </Stack>
  );
}
