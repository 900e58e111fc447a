import {
  Group,
  SegmentedControl,
  SimpleGrid,
  Skeleton,
  Stack,
  Switch,
  Text,
  TextInput,
  Title,
  useMantineColorScheme,
} from "@mantine/core";
import { useSystem } from "../../api/system";
import { speak } from "../../live/speak";
import { ErrorNotice } from "../../ui/ErrorNotice";
import { Panel } from "../../ui/Panel";
import { useOperatorName, useSpeechWanted } from "../../ui/usePreferences";
import { useTitle } from "../../ui/useTitle";
import { About } from "./About";
import { Backup } from "./Backup";
import { RemoteAccess } from "./RemoteAccess";

const THEMES = [
  { value: "light", label: "Light" },
  { value: "dark", label: "Dark" },
  { value: "auto", label: "System" },
] as const;

/** Preferences of this browser, and information about the server. */
export function SettingsPage() {
  useTitle("Settings");
  const system = useSystem();
  return (
    <>
      <Group justify="space-between" gap={12} mb={14}>
        <Title order={1}>Settings</Title>
      </Group>
      <SimpleGrid cols={{ base: 1, sm: 2 }} spacing="var(--gap)" style={{ alignItems: "start" }}>
        <Stack gap="var(--gap)">
          <Panel title="This browser">
            <ThisBrowser />
          </Panel>
          {system.data && <About system={system.data} />}
        </Stack>
        {system.data === undefined ? (
          <div>
            <ErrorNotice error={system.error} />
            {system.isPending && <Skeleton height={320} radius="md" aria-busy="true" />}
          </div>
        ) : (
          <Stack gap="var(--gap)">
            <RemoteAccess system={system.data} />
            <Backup system={system.data} />
          </Stack>
        )}
      </SimpleGrid>
    </>
  );
}

function ThisBrowser() {
  const { colorScheme, setColorScheme } = useMantineColorScheme();
  const [name, setName] = useOperatorName();
  const [speech, setSpeech] = useSpeechWanted();
  const canSpeak = "speechSynthesis" in window;
  return (
    <Stack gap={18}>
      <div>
        <Text fw={550} mb={6} id="appearance">
          Appearance
        </Text>
        <SegmentedControl
          aria-labelledby="appearance"
          size="md"
          data={[...THEMES]}
          value={colorScheme}
          onChange={(value) => setColorScheme(value as typeof colorScheme)}
        />
      </div>
      <Switch
        label="Spoken announcements"
        description={
          canSpeak
            ? "“Landed, captured, 0.24 metres.” After a reload, tap the page once to enable speech."
            : "This browser does not support speech. Screen readers still receive the announcements."
        }
        size="md"
        checked={speech}
        disabled={!canSpeak}
        onChange={({ currentTarget: { checked } }) => {
          setSpeech(checked);
          if (checked) speak({ text: "Announcements are on.", urgent: true });
        }}
      />
      <TextInput
        label="Your name"
        description="Used when you take control of a vehicle, and visible to all users."
        value={name}
        maxLength={80}
        autoComplete="name"
        onChange={({ currentTarget: { value } }) => setName(value)}
      />
    </Stack>
  );
}
