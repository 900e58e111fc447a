import { Button, Group } from "@mantine/core";
import { useClipboard } from "@mantine/hooks";
import { IconDownload, IconLink } from "@tabler/icons-react";
import type { ReactNode } from "react";
import { type LogPlace, logFile } from "../../api/logAnalyses";
import { bytesText } from "../../ui/format";

/** The answer in other forms, the file if it is stored, and the page's address. */
export function Downloads({ log: { id, file_name, file_bytes } }: { log: LogPlace }) {
  return (
    <Group gap={8}>
      <CopyLink />
      <Download href={logFile(id, "export.html")} name={`${file_name}.html`}>
        HTML
      </Download>
      <Download href={logFile(id, "export.json")} name={`${file_name}.json`}>
        JSON
      </Download>
      {file_bytes > 0 && (
        <Download href={logFile(id, "file")} name={file_name}>
          Log file, {bytesText(file_bytes)}
        </Download>
      )}
    </Group>
  );
}

interface DownloadProps {
  href: string;
  name: string;
  children: ReactNode;
}

export function Download({ href, name, children }: DownloadProps) {
  return (
    <Button
      component="a"
      variant="default"
      href={href}
      download={name}
      leftSection={<IconDownload size={18} aria-hidden />}
    >
      {children}
    </Button>
  );
}

/** Copies the address; over plain http browsers allow no page to do so. */
function CopyLink() {
  const { copy, copied, error } = useClipboard();
  return (
    <Button
      variant="default"
      leftSection={<IconLink size={18} aria-hidden />}
      onClick={() => copy(window.location.href)}
    >
      <span role="status">{error ? "Copy it from the address bar" : copied ? "Link copied" : "Copy link"}</span>
    </Button>
  );
}
