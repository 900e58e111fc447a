import { Button, Group, TextInput } from "@mantine/core";

/** Input for the gains of a log that does not contain them. */
export function GainsAsked({ name, onGains }: { name: string; onGains: (gains: string) => void }) {
  return (
    <form action={(entered) => onGains(String(entered.get("gains")).replaceAll(/\s+/g, ""))}>
      <Group gap={10} mt={10} align="end">
        <TextInput name="gains" label="Gains flown: kp, ki, kd" placeholder="283, 13, 82" required />
        <Button type="submit">Analyse {name} with these gains</Button>
      </Group>
    </form>
  );
}
