import {
  Anchor,
  Box,
  Button,
  Checkbox,
  Group,
  SegmentedControl,
  SimpleGrid,
  Skeleton,
  Stack,
  Text,
  TextInput,
  Title,
  useMantineColorScheme,
} from "@mantine/core";
import { IconDownload } from "@tabler/icons-react";
import { useState } from "react";
import { useDownload } from "../../api/files";
import { BACKUP, codeOf, type System, useSystem } from "../../api/system";
import { speak } from "../../live/speech";
import { Aside } from "../../ui/Aside";
import { SelectField } from "../../ui/Fields";
import { bytesText } from "../../ui/format";
import { LabelledValue } from "../../ui/LabelledValue";
import { Note } from "../../ui/Note";
import { ErrorNotice, withCode } from "../../ui/Notices";
import { Panel } from "../../ui/Panel";
import { useOperatorName, useSpeechWanted } from "../../ui/usePreferences";
import { useTitle } from "../../ui/useTitle";
import fleet from "../fleet/Fleet.module.css";
import classes from "./SettingsPage.module.css";

const THEMES = [
  { value: "light", label: "Light" },
  { value: "dark", label: "Dark" },
  { value: "auto", label: "System" },
];

/** Preferences of this browser, and information about the server. */
export function SettingsPage() {
  useTitle("Settings");
  const system = useSystem();
  return (
    <>
      <Title order={1} mb={14}>
        Settings
      </Title>
      <SimpleGrid type="container" cols={{ base: 1, "780px": 2 }} spacing="var(--gap)">
        <Stack gap="var(--gap)" className={classes["column"]}>
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
          <Stack gap="var(--gap)" className={classes["column"]}>
            <Panel title="Open on a tablet">
              <Stack gap={18}>
                {system.data.addresses.length > 0 ? (
                  <Reachable system={system.data} />
                ) : (
                  <LocalOnly system={system.data} />
                )}
              </Stack>
            </Panel>
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
          data={THEMES}
          value={colorScheme}
          onChange={(value) => setColorScheme(value as typeof colorScheme)}
        />
      </div>
      <Checkbox
        label="Spoken announcements"
        description={
          canSpeak
            ? "“Landed, needs review, 0.24 metres.” After a reload, tap the page once to enable speech."
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

const WORKER: Record<System["worker"], string> = {
  running: "Running",
  "not answering": "Not responding",
  absent: "Not running",
};
const SCARCE_BYTES = 1e9;

/** Version and resources of the server, for bug reports. */
function About({ system }: { system: System }) {
  const scarce = system.free_bytes < SCARCE_BYTES;
  return (
    <Panel title="This server">
      <dl className={fleet["facts"]}>
        <LabelledValue title="Version" value={system.version} />
        <LabelledValue title="Worker" value={WORKER[system.worker]} bad={system.worker !== "running"} />
        <LabelledValue title="Database" value={`revision ${system.database_revision}`} />
        <LabelledValue title="Data size" value={bytesText(system.data_bytes)} />
        <LabelledValue
          title={scarce ? "Free disk space, low" : "Free disk space"}
          value={bytesText(system.free_bytes)}
          bad={scarce}
        />
        <LabelledValue title="Data folder" value={system.data_dir} />
      </dl>
    </Panel>
  );
}

/** Download of a backup, and how to restore it. */
function Backup({ system }: { system: System }) {
  const backup = useDownload(BACKUP);
  return (
    <Panel title="Backup">
      <Stack gap={18}>
        <Note>
          One file with the current state of all campaigns, flights and vehicles, about{" "}
          {bytesText(system.database_bytes)}. Flights and computations continue during the download. Telemetry logs
          (folder tlogs) are not included.
        </Note>
        <div>
          <Button
            leftSection={<IconDownload size={18} aria-hidden />}
            loading={backup.isPending}
            onClick={() => backup.mutate()}
          >
            Download backup
          </Button>
        </div>
        <ErrorNotice error={backup.error} />
        <details>
          <summary>How to restore a backup</summary>
          <ol className={classes["steps"]}>
            <li>Stop Gainline.</li>
            <li>
              In {system.data_dir}, delete gainline.sqlite3-wal and gainline.sqlite3-shm, and move gainline.sqlite3 to
              another folder.
            </li>
            <li>Copy the backup there as gainline.sqlite3.</li>
            <li>Start Gainline. A backup of an earlier version is migrated.</li>
          </ol>
        </details>
      </Stack>
    </Panel>
  );
}

/** How to open this dashboard on another device, and the security consequences. */
function Reachable({ system: { addresses, exposes, host, in_container } }: { system: System }) {
  const urls = addresses.map(({ url }) => url);
  const [chosen, setChosen] = useState(urls[0] ?? "");
  return (
    <>
      {addresses.length > 1 && (
        <SelectField
          label="Network"
          value={chosen}
          onChange={setChosen}
          data={addresses.map(({ url, interface: name }) => ({ value: url, label: `${name}: ${url}` }))}
        />
      )}
      <Group gap={18}>
        <Box
          component="img"
          src={codeOf(chosen)}
          alt={`QR code of ${chosen}`}
          width={220}
          height={220}
          bd="1px solid var(--hairline)"
          bdrs="md"
        />
        <Note flex="1 1 230px">
          Scan the code with the tablet’s camera, or enter
          <Anchor href={chosen} display="block" py={12} fz="title" fw={650} style={{ overflowWrap: "anywhere" }}>
            {chosen}
          </Anchor>
          Both devices must be on the same network. The tablet has read-only access. To change campaigns and fly
          simulations from it, open the link that <code>gainline unlock</code> prints on this computer.
        </Note>
      </Group>
      {in_container && (
        <Note>
          Gainline runs in a container, and this is the container’s address. If the tablet cannot reach it, use the
          computer’s address and the published port.
        </Note>
      )}
      <Aside tone="warn">
        <strong>The server listens on {host}</strong>, so {withCode(exposes)}
      </Aside>
    </>
  );
}

/** Why no other device can open it. */
function LocalOnly({ system: { exposes, host, is_exposed } }: { system: System }) {
  if (is_exposed) {
    return <Note>The server listens on {host}, but this computer is not connected to a network.</Note>;
  }
  return (
    <>
      <Note>
        Only this computer can open the dashboard, because the server listens on {host}. To open it on a tablet on the
        same network, stop the server and start it with
      </Note>
      <code className={classes["command"]}>gainline serve --host 0.0.0.0</code>
      <Note>or, in a checkout, with ./dev up --host 0.0.0.0. The address then appears here.</Note>
      <Aside tone="warn">
        <strong>Security:</strong> {withCode(exposes)}
      </Aside>
    </>
  );
}
